(An outer thread M8 x 1.25, 12 mm long, on a bar of 8 mm. X in diameters, Z 0 at the face of the bar)
G21 G90 G18 G7
M3 S500
G4 P3
G0 X10 Z4
(The first pass is 0.25 mm deep, the last 0.77 mm; one flank cuts, and the tool leaves the cut along 1.2 mm)
G76 P1.25 Z-12 I-2 J0.5 K1.54 R2 Q29.5 H1 E1.2 L2
G0 X30
M5
M30
