"""SII, the EEPROM image of a SubDevice."""
