-- Checksum of what a record says, of which run and in which place, CRC-32 (ISO-HDLC); empty for those of before.
ALTER TABLE records ADD COLUMN sum BIGINT;
