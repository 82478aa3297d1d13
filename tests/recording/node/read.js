// Reads a recording with @mcap/core alone and says what it found, as JSON.
const fs = require("fs/promises");
const { McapIndexedReader } = require("@mcap/core");
const fzstd = require("fzstd");

async function open(path) {
  const file = await fs.open(path);
  return {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const data = new Uint8Array(Number(length));
      await file.read(data, 0, Number(length), Number(offset));
      return data;
    },
  };
}

// The records' schema says where things lie; nothing else is known of them here.
function cycles(schema, data) {
  const field = schema.fields.find((each) => each.name === "cycle");
  const inputs = schema.fields.find((each) => each.name === "inputs");
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const found = [];
  for (let at = 0; at < data.byteLength; at += schema.size) {
    found.push([Number(view.getBigUint64(at + field.offset, true)), view.getFloat64(at + inputs.offset, true)]);
  }
  return found;
}

async function main() {
  const zstd = (data, size) => fzstd.decompress(data, new Uint8Array(Number(size)));
  const reader = await McapIndexedReader.Initialize({
    readable: await open(process.argv[2]),
    decompressHandlers: { zstd },
  });
  const found = { counts: {}, records: [], inputs: [], times: [], schemas: {}, attachments: [] };
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    const text = new TextDecoder().decode(schema.data);
    found.schemas[channel.topic] = schema.encoding;
    found.counts[channel.topic] = (found.counts[channel.topic] ?? 0) + 1;
    if (channel.topic === "/hm2/records") {
      found.records.push(...cycles(JSON.parse(text), message.data));
    } else if (channel.topic === "/hm2/inputs") {
      found.inputs.push(JSON.parse(new TextDecoder().decode(message.data)));
      found.times.push(message.logTime.toString());
    }
  }
  for await (const attachment of reader.readAttachments()) found.attachments.push(attachment.name);
  console.log(JSON.stringify(found));
}

main();
