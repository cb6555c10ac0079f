"""Models as one C99 header: fixed steps without allocation for flight software and model-in-the-loop, its error measured and stated."""

from thermid.interop.c99.header import to_c as to_c
