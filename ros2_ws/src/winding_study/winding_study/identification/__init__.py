"""Which material follows from several runs of a cable, or from a tensile test?"""
