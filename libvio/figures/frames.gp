# The frames of the library: gnuplot libvio/figures/frames.gp writes frames.svg beside this file.
set terminal svg size 820,400 font "sans,15" background "white"
set output "libvio/figures/frames.svg"
unset border; unset tics; unset key
set lmargin 0; set rmargin 0; set tmargin 0; set bmargin 0
set xrange [0:82]; set yrange [0:40]

set style arrow 1 lw 2.5 lc rgb "#d62728" filled size 1.2,22   # x
set style arrow 2 lw 2.5 lc rgb "#2ca02c" filled size 1.2,22   # y
set style arrow 3 lw 2.5 lc rgb "#1f77b4" filled size 1.2,22   # z
set style arrow 4 lw 1.4 dt 2 lc rgb "#555555" filled size 1.2,16
set style arrow 5 lw 1.4 lc rgb "#c06000" filled size 1.2,16
set style arrow 6 lw 2.5 lc rgb "#777777" filled size 1.2,22

# W world, z up, and gravity
set arrow from 8,8 rto 10,-2 as 1;   set label "x" at 18.6,5.8
set arrow from 8,8 rto 6,5 as 2;     set label "y" at 14.5,13.6
set arrow from 8,8 rto 0,10 as 3;    set label "z, up" at 6.2,19.4
set label "W  world" at 2,4.6 font "sans,18"
set arrow from 3,27 rto 0,-8 as 6;   set label "g_W" at 4,23 noenhanced

# B vehicle: x forward, y left, z up
set arrow from 36,13 rto 10,-1 as 1; set label "x" at 46.6,11.6
set arrow from 36,13 rto 4,5 as 2;   set label "y" at 40.4,18.8
set arrow from 36,13 rto -0.8,9 as 3; set label "z" at 33.2,21.6
set label "B  vehicle" at 33,9.6 font "sans,18"

# I IMU, mounted as it may
set arrow from 31,31 rto 6,1.5 as 1
set arrow from 31,31 rto -3,4 as 2
set arrow from 31,31 rto 1.5,6 as 3
set label "I  IMU" at 22.6,30 font "sans,18"

# C camera: x right, y down, z forward
set arrow from 56,24 rto -2.5,-4.5 as 1; set label "x" at 51.9,18.6
set arrow from 56,24 rto 0.8,-8 as 2;  set label "y" at 57.2,15.2
set arrow from 56,24 rto 9,-0.6 as 3; set label "z, optical axis" at 65.8,23.2
set label "C  camera" at 50,27 font "sans,18"

# Transformations: from the frame on the left of the name to that on the right
set arrow from 8,8 to 35,12.8 as 4;    set label "T_W_B" at 24,12.4 noenhanced center tc rgb "#555555"
set arrow from 36,13 to 31.3,30 as 4;  set label "T_B_I" at 30.4,23 noenhanced center tc rgb "#555555"
set arrow from 36,13 to 55.2,23.6 as 4; set label "T_B_C" at 47.2,17 noenhanced center tc rgb "#555555"
set arrow from 31,31 to 55,24.6 as 4;  set label "T_I_C" at 43,29.4 noenhanced center tc rgb "#555555"

# A landmark
set label "" at 74,34 point pt 7 ps 1 lc rgb "#c06000"
set arrow from 56,24 to 73.4,33.6 as 5
set label "p_C_f = T_C_W p_W_f" at 63,32.4 noenhanced center tc rgb "#c06000"
set label "landmark f" at 70,36.4 noenhanced tc rgb "#c06000"
plot NaN notitle
