%
(1002)
(Using high feed G1 F1000. instead of G0.)
(T2 D=6. CR=0. - ZMIN=-2. - flat end mill)
G90 G94
G17
G21
G53 G0 Z0.
(Pocket)
T2
M6
S12000 M3
G17 G90 G94
G54
G0 X5. Y5.
Z5.
G1 Z-2. F200.
G3 X9. Y5. Z-2.2 I2. J0. F600.
X5. Y5. Z-2.4 I-2. J0.
X9. Y5. I2. J0.
X5. Y5. I-2. J0.
G0 Z5.
M9
M5
G53 G0 Z0.
M30
%
