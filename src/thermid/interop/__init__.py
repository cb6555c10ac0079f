"""Exchange with other tools: InitFcn scripts in; Octave, SPICE and equations as text out."""
