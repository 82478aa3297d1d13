/* A bus with an SSERIAL mailbox that does as the test says: which commands complete, which exchanges fail. */
#ifndef HM2_TEST_MAILBOX_H
#define HM2_TEST_MAILBOX_H

#include <string.h>

#include "check.h"
#include "hm2.h"

enum { BASE = 0x5A00, COMMAND = 0x5A00, DATA = 0x5B00, CS = 0x5C00, USER0 = 0x5D00, COMMANDS = 64 };

struct mailbox {
	uint32_t words[HM2_ADDRESS_SPACE / 4];
	int64_t now_ns;
	uint32_t commands[COMMANDS]; /* as written, the first ones */
	uint64_t zeroed; /* to which registers 0 was written: bit 8 * (register - CS) + channel */
	size_t count;
	int (*completes)(struct mailbox *mailbox, uint32_t command);
	int fail_next; /* this many exchanges fail */
	int fail_status; /* with this; 0: HM2_ERR_IO */
	int fail_at; /* the exchange of this number fails; 0: none */
	int exchanges;
	int fail_writes; /* this many exchanges with a write in front fail */
	int64_t exchange_ns; /* what each takes */
	int64_t takes_ns; /* so long a command is at work */
	int64_t done_ns; /* when the last one is over */
	int64_t slow_ns; /* the next exchange takes so much longer */
	void (*looked)(void); /* at each look at the clock */
	struct hm2_board *board;
	struct hm2_sserial *port;
	hm2_error error;
};

static void mailbox_write(struct mailbox *mailbox, uint32_t address, uint32_t word)
{
	if (address >= CS && word == 0)
		mailbox->zeroed |= (uint64_t)1 << ((address - CS) / 0x100 * 8 + (address - CS) % 0x100 / 4) % 64;
	if (address != COMMAND) {
		if (address < CS) /* what is written to CS and interface data is not what is read there */
			mailbox->words[address / 4] = word;
		return;
	}
	if (word & 0x80000000u)
		return;
	if (mailbox->count < COMMANDS)
		mailbox->commands[mailbox->count] = word;
	mailbox->count++;
	mailbox->words[COMMAND / 4] = mailbox->completes(mailbox, word) && !mailbox->takes_ns ? 0 : word;
	mailbox->done_ns = mailbox->now_ns + mailbox->takes_ns;
}

static int mailbox_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct mailbox *mailbox = self;
	int *fails = transfers[0].flags & HM2_TRANSFER_WRITE && mailbox->fail_writes ? &mailbox->fail_writes
	                                                                            : &mailbox->fail_next;
	if (++mailbox->exchanges == mailbox->fail_at || *fails) {
		*fails -= *fails > 0;
		const int status = mailbox->fail_status ? mailbox->fail_status : HM2_ERR_IO;
		if (error)
			error->status = status;
		return status;
	}
	if (mailbox->takes_ns && mailbox->now_ns >= mailbox->done_ns)
		mailbox->words[COMMAND / 4] = 0;
	for (size_t i = 0; i < count; i++) {
		for (uint32_t n = 0; n < transfers[i].count; n++) {
			const uint32_t address = transfers[i].address + 4 * n;
			if (transfers[i].flags & HM2_TRANSFER_WRITE)
				mailbox_write(mailbox, address, transfers[i].words[n]);
			else
				transfers[i].words[n] = mailbox->words[address / 4];
		}
	}
	mailbox->now_ns += mailbox->exchange_ns + mailbox->slow_ns;
	mailbox->slow_ns = 0;
	return HM2_OK;
}

static int mailbox_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)self;
	(void)deadline_ns;
	(void)error;
	return HM2_OK;
}

static int64_t mailbox_now_ns(void *self)
{
	struct mailbox *mailbox = self;
	if (mailbox->looked)
		mailbox->looked();
	return mailbox->now_ns;
}

static void mailbox_pause_ns(void *self, int64_t ns)
{
	if (ns > 0)
		((struct mailbox *)self)->now_ns += ns;
}

static void mailbox_close(void *self)
{
	(void)self;
}

static int always(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	return command != 0x4000;
}

static void mailbox_open(struct mailbox *mailbox)
{
	const hm2_bus bus = {mailbox, mailbox_begin, mailbox_finish, mailbox_now_ns, mailbox_pause_ns, mailbox_close, NULL};
	const hm2_sserial_config config = {BASE, 0x100, 0x40, 0, 8, 3};
	memset(mailbox, 0, sizeof *mailbox);
	mailbox->completes = always;
	mailbox->exchange_ns = 1000;
	CHECK_EQUAL(hm2_board_open(&bus, &mailbox->board, NULL), HM2_OK);
	CHECK_EQUAL(hm2_sserial_open(mailbox->board, &config, &mailbox->port, NULL), HM2_OK);
}

static void mailbox_free(struct mailbox *mailbox)
{
	hm2_sserial_free(mailbox->port);
	hm2_board_free(mailbox->board);
}

#endif
