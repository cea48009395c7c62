"""Messages as the bytes that DDS carries, without message objects: little-endian CDR."""
