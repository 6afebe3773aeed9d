"""Tables of text without a mapping file: their layout, units and mapping are found from headers and values."""
