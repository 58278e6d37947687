"""How a status reads for people, in a terminal as in a window. Pure text: needs neither of them."""
