/* The parts of the Ethernet transport: what a datagram is, and the state of a link. */
#ifndef HM2_UDP_H
#define HM2_UDP_H

#include "hm2.h"

#define UDP_WINDOW 8 /* datagrams under way at once: fits the receive memory of the card's network chip */
#define UDP_OVERHEAD 8 /* of every reply: the number before, the datagram's own */

/* A place in a list of transfers. */
struct udp_position {
	size_t transfer;
	uint32_t word;
};

struct udp_datagram {
	uint32_t sequence;
	uint32_t first;     /* the number it was first sent under; repeats get new ones */
	size_t length;
	size_t sequence_at; /* where its number stands in bytes */
	size_t reply_size;
	int answered;
	int writes;         /* holds a write besides its number */
	int once;           /* holds something that must not be asked for twice */
	struct udp_position start, end;
	uint8_t bytes[HM2_LBP16_MAX_PAYLOAD];
};

struct udp_list {
	const hm2_transfer *transfers;
	size_t count;
	struct udp_position at; /* first word not yet in a datagram */
};

#define UDP_COMPILED 128
#define UDP_WORDS (HM2_LBP16_MAX_PAYLOAD / 4)

/* A list that fits one datagram, as the last begin sent it. A cycle's list is the same each time, so its
 * datagram is made once and then only gets new data and a new number; where each word goes is known. */
struct udp_compiled {
	size_t count; /* 0: none. The datagram is window[0]. */
	struct udp_position end;
	size_t reads, writes;                /* words */
	uint32_t *read[UDP_WORDS];           /* where the reply's words go, one behind the other */
	const uint32_t *write[UDP_WORDS];    /* where the request's come from */
	uint16_t write_at[UDP_WORDS];        /* and where they stand in it */
	hm2_transfer transfers[UDP_COMPILED];
};

struct hm2_udp {
	hm2_carrier carrier;
	hm2_udp_config config;
	hm2_udp_counters counters;
	uint32_t sequence;   /* last one sent */
	uint32_t confirmed;  /* newest one the card is known to have carried out */
	int synchronized;    /* confirmed is known */
	uint64_t disturbances; /* an old request was carried out after a newer one, or one that writes twice */
	uint64_t wrote;      /* bit (sequence & 63): that datagram held writes */
	uint32_t probe;      /* number of the last question what the card has carried out */
	uint32_t probe_answer;
	int probe_pending;   /* asked and not answered */
	int probes;          /* answers in a row that say "not carried out" */
	struct udp_list list;
	struct udp_compiled compiled;
	uint8_t *raw; /* where the reply of hm2_udp_lbp16 goes; NULL for a list */
	int sent, unanswered;
	struct udp_datagram window[UDP_WINDOW];
	uint8_t reply[HM2_LBP16_MAX_PAYLOAD + 4];
};

/* udp_datagram.c: bytes, no socket */

/* Start a datagram: it reads the card's last number. */
void udp_datagram_open(struct udp_datagram *datagram);
/* End it: it writes its number (set by udp_datagram_number) and reads it back. */
void udp_datagram_close(struct udp_datagram *datagram);
void udp_datagram_number(struct udp_datagram *datagram, uint32_t sequence);
/* As many transfers as fit, from list->at, which moves. Opens and closes. */
void udp_datagram_pack(struct udp_datagram *datagram, struct udp_list *list);
/* The words of a reply into the list's transfers. */
void udp_datagram_unpack(const struct udp_datagram *datagram, const struct udp_list *list, const uint8_t *reply);
/* Take out every write but its number: what is left may be asked for again. */
void udp_datagram_strip(struct udp_datagram *datagram);
/* Commands of a caller; HM2_ERR_RANGE when they do not fit. */
int udp_datagram_raw(struct udp_datagram *datagram, const uint8_t *commands, size_t length, size_t reply_size);
/* "What have you carried out?": the request, and the length of its answer. */
#define UDP_PROBE_REPLY 10
size_t udp_probe(uint8_t *bytes, size_t capacity, uint32_t number);

static inline uint32_t udp_get32(const uint8_t *bytes)
{
	return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static inline void udp_put32(uint8_t *bytes, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		bytes[i] = (uint8_t)(value >> 8 * i);
}

/* udp_compiled.c: a cycle's datagram */

/* Remember the list if it is in this datagram whole; forget what was remembered if not. */
void udp_compile(struct udp_compiled *compiled, const struct udp_datagram *datagram, const struct udp_list *list);
int udp_compiled_same(const struct udp_compiled *compiled, const struct udp_list *list);
/* The words to be written, as they are now, into its datagram. */
void udp_compiled_refill(const struct udp_compiled *compiled, struct udp_datagram *datagram);
/* The words of its reply to where they belong. */
void udp_compiled_unpack(const struct udp_compiled *compiled, const uint8_t *reply);

/* udp_receive.c: what a datagram that came in means */
#define UDP_RECENT 65536u /* numbers this close can only be ours: the first one was drawn at random */
/* 1: it answers the probe. */
int udp_receive(struct hm2_udp *udp, const uint8_t *reply, size_t length);

/* udp_retry.c: an exchange unanswered for retry_ns; what a probe's answer leads to */
int udp_retry(struct hm2_udp *udp, hm2_error *error);
int udp_retry_answered(struct hm2_udp *udp, hm2_error *error);

/* udp_exchange.c: sending and waiting */
int udp_send_window(struct hm2_udp *udp, hm2_error *error);
int udp_await(struct hm2_udp *udp, int64_t deadline_ns, hm2_error *error);
int udp_send_datagram(struct hm2_udp *udp, struct udp_datagram *datagram, hm2_error *error);
int udp_send_bytes(struct hm2_udp *udp, const uint8_t *bytes, size_t length, hm2_error *error);

#endif
