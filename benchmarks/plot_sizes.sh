#!/usr/bin/env bash
# plot_sizes.sh CSV SVG: draws what bench_stats_mean_sizes printed, ns per feature against the number of features.
set -euo pipefail
if [ $# -ne 2 ] || [ ! -r "$1" ]; then
  echo "usage: plot_sizes.sh CSV SVG; CSV is the output of bench_stats_mean_sizes" >&2
  exit 2
fi
gnuplot <<END
set terminal svg size 720,420 dynamic font 'Helvetica,13' noenhanced name 'mean_sizes' background '#ffffff'
set output '$2'
set datafile separator ','
set datafile commentschars '#'
set logscale xy
set xlabel 'features'
set ylabel 'ns per feature, mean and covariance'
set format x '10^{%L}'
set termoption enhanced
set key below maxrows 3 noenhanced
set grid
plot '$1' skip 1 using 1:7 with linespoints lw 2 lc rgb '#777777' title 'rotations, by hand in Eigen', \
  '' skip 1 using 1:6 with linespoints lw 2 lc rgb '#aa3377' title 'SE3, group mean', \
  '' skip 1 using 1:5 with linespoints lw 2 lc rgb '#228833' title 'frames', \
  '' skip 1 using 1:4 with linespoints lw 2 lc rgb '#ccbb44' title 'directions', \
  '' skip 1 using 1:3 with linespoints lw 2 lc rgb '#4477aa' title 'rotations', \
  '' skip 1 using 1:2 with lines lw 2 dt 2 lc rgb '#000000' title 'reading the rotations once'
END
