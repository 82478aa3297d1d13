/* The 93C46 behind space 2: MAC, card name, IP address. Fact sheet lbp16.md 5. */
#include "ethernet.h"

#include <string.h>

#define PUBLIC_START HM2_LBP16_EEPROM_IP_LOW /* below: MAC and name, for the factory key alone */

void ethernet_eeprom_init(struct hm2_ethernet *ethernet)
{
	const hm2_ethernet_config *config = &ethernet->config;
	uint16_t *words = ethernet->eeprom;

	memset(words, 0, sizeof ethernet->eeprom);
	for (int i = 0; i < 3; i++) /* low word first, so that six bytes read backwards */
		words[HM2_LBP16_EEPROM_MAC / 2 + i] = (uint16_t)(config->mac[4 - 2 * i] << 8 | config->mac[5 - 2 * i]);
	for (int i = 0; i < 8; i++)
		words[HM2_LBP16_EEPROM_CARD_NAME / 2 + i] =
			(uint16_t)((uint8_t)config->name[2 * i] | (uint8_t)config->name[2 * i + 1] << 8);
	words[HM2_LBP16_EEPROM_IP_LOW / 2] = (uint16_t)(config->ip[2] << 8 | config->ip[3]);
	words[HM2_LBP16_EEPROM_IP_HIGH / 2] = (uint16_t)(config->ip[0] << 8 | config->ip[1]);
}

int ethernet_eeprom_write(struct hm2_ethernet *ethernet, uint16_t address, uint16_t value)
{
	const uint16_t key = ethernet->status[STATUS_KEY];

	if (key != HM2_LBP16_KEY_FACTORY && (key != HM2_LBP16_KEY_EEPROM || address < PUBLIC_START))
		return HM2_LBP16_ERROR_WRITE;
	ethernet->eeprom[address / 2] = value;
	return 0;
}
