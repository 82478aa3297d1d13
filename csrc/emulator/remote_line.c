/* A remote on its line: frames out of timed bytes, answers into timed bytes.
 *
 * A frame ends where its commands end and the next byte is their CRC: the length of every command is
 * known from its header, so nobody has to wait for a gap. A gap longer than the timeout (local
 * register 0xCB) throws away what has not become a frame by then. Without CRC every command is a
 * frame of its own. */
#include "line.h"
#include "remote_state.h"

#include <string.h>

static void start_frame(remote_receiver *rx)
{
	rx->length = rx->boundary = rx->need = 0;
	rx->crc = 0;
}

/* What came is no frame. Nothing is answered, the error shows in the LBP status. */
static void give_up(hm2_remote *remote)
{
	remote_receiver *rx = &remote->rx;

	if (rx->length) {
		remote_crc_error(remote);
		if (rx->need > rx->length)
			remote_set_status(remote, HM2_LBP_STATUS_COMMAND_TIMEOUT);
	}
	start_frame(rx);
}

static void discard_until_gap(hm2_remote *remote)
{
	give_up(remote);
	remote->rx.discarding = 1;
}

static void end_frame_at_gap(hm2_remote *remote, int64_t now_ps)
{
	remote_receiver *rx = &remote->rx;

	if ((!rx->length && !rx->discarding) || !remote->knob[HM2_REMOTE_TIMEOUT_BITS])
		return;
	if (now_ps - rx->end_ps <= remote->knob[HM2_REMOTE_TIMEOUT_BITS] * remote->bit_ps)
		return;
	give_up(remote);
	rx->discarding = 0;
}

static void transmit(hm2_remote *remote, const remote_answer *answer, int64_t start_ps)
{
	remote_transmitter *tx = &remote->tx;

	if (tx->count + answer->length > TX_QUEUE) {
		remote_set_status(remote, HM2_LBP_STATUS_BUFFER);
		return;
	}
	if (start_ps < tx->free_ps)
		start_ps = tx->free_ps;
	for (size_t i = 0; i < answer->length; i++) {
		tx->queue[(tx->head + tx->count++) % TX_QUEUE] = (hm2_line_byte){
			.start_ps = start_ps,
			.bit_ps = remote->bit_ps,
			.value = answer->bytes[i],
			.framing_error = answer->broken && i + 1 == answer->length,
		};
		start_ps += BITS_PER_BYTE * remote->bit_ps;
	}
	tx->free_ps = start_ps;
}

static void end_frame(hm2_remote *remote, size_t length, int64_t heard_ps)
{
	remote_answer answer;
	int64_t start_ps = heard_ps + remote->knob[HM2_REMOTE_TURNAROUND_PS];
	int64_t free_ps = remote->busy_ps; /* of earlier commands: a commit is acknowledged before its work */
	int silent = remote_obey(remote, remote->rx.frame, length, &answer);

	start_frame(&remote->rx);
	if (!silent && remote_finish_answer(remote, &answer))
		transmit(remote, &answer, (start_ps < free_ps ? free_ps : start_ps) + answer.late_ps);
}

/* The byte just stored is the header of a further command. */
static void start_command(hm2_remote *remote)
{
	remote_receiver *rx = &remote->rx;
	size_t length = remote_command_length(remote, rx->frame[rx->length - 1]);

	if (length == 0 || rx->length + length > FRAME_MAX) {
		remote_set_status(remote, length ? HM2_LBP_STATUS_BUFFER : HM2_LBP_STATUS_INVALID_ADDRESS);
		discard_until_gap(remote);
		return;
	}
	rx->need = rx->length - 1 + length;
}

/* A frame that begins with "reset parser" begins anew with the byte behind it. */
static void after_parser_reset(remote_receiver *rx)
{
	if (rx->boundary != 1 || rx->frame[0] != HM2_LBP_COMMAND_RESET_PARSER)
		return;
	rx->frame[0] = rx->frame[1];
	rx->length = 1;
	rx->boundary = rx->need = 0;
	rx->crc = hm2_lbp_crc8_add(0, rx->frame[0]);
}

static void take_byte(hm2_remote *remote, uint8_t value, int64_t heard_ps)
{
	remote_receiver *rx = &remote->rx;
	int between = rx->length == rx->need;

	if (between && rx->length && value == rx->crc) { /* without CRC no frame is so far */
		end_frame(remote, rx->length, heard_ps);
		return;
	}
	if (rx->length == FRAME_MAX) { /* start_command leaves room; a bound on what the wire fills stays beside it */
		remote_set_status(remote, HM2_LBP_STATUS_BUFFER);
		discard_until_gap(remote);
		return;
	}
	rx->frame[rx->length++] = value;
	rx->crc = hm2_lbp_crc8_add(rx->crc, value);
	if (between) {
		after_parser_reset(rx);
		start_command(remote);
	}
	if (rx->length && rx->length == rx->need) {
		rx->boundary = rx->length;
		if (!remote->knob[HM2_REMOTE_CRC])
			end_frame(remote, rx->length, heard_ps);
	}
}

void hm2_remote_line_receive(hm2_remote *remote, const hm2_line_byte *byte)
{
	int64_t heard_ps = line_heard_ps(byte, byte->bit_ps);

	if (!remote_alive(remote))
		return;
	end_frame_at_gap(remote, byte->start_ps);
	remote->rx.end_ps = byte->start_ps + BITS_PER_BYTE * byte->bit_ps;
	if (heard_ps > remote->now_ps) {
		remote->now_ps = heard_ps;
		remote_check_watchdog(remote);
	}
	if (line_misheard(byte, remote->bit_ps))
		discard_until_gap(remote);
	else if (!remote->rx.discarding)
		take_byte(remote, byte->value, heard_ps);
}

int hm2_remote_line_peek(hm2_remote *remote, hm2_line_byte *byte)
{
	if (remote->tx.count == 0)
		return 0;
	*byte = remote->tx.queue[remote->tx.head];
	return 1;
}

void hm2_remote_line_pop(hm2_remote *remote)
{
	if (remote->tx.count == 0)
		return;
	remote->tx.head = (remote->tx.head + 1) % TX_QUEUE;
	remote->tx.count--;
}

void hm2_remote_advance(hm2_remote *remote, int64_t now_ps)
{
	if (!remote_alive(remote) || now_ps < remote->now_ps)
		return;
	remote->now_ps = now_ps;
	/* A byte whose stop bit is still to come may have started before now. */
	end_frame_at_gap(remote, now_ps - BITS_PER_BYTE * remote->bit_ps);
	remote_check_watchdog(remote);
}
