"""What decoders raise."""


class MessageError(ValueError):
    """A message does not say what its topic promises."""
