//! Step jitter at a million steps a second.

/// Returns the rate of a motor in steps/s, its peak-to-peak jitter (the longest interval between steps less the
/// shortest) in cycles, and the largest deviation of a step from an even sequence, us.
pub fn evenness(times: &[u64]) -> (f64, u64, f64) {
    let gaps = || times.windows(2).map(|pair| pair[1] - pair[0]);
    let spread = gaps().max().unwrap_or(0) - gaps().min().unwrap_or(0);
    let n = times.len() as f64;
    let first = times.first().copied().unwrap_or(0);
    let points = || times.iter().enumerate().map(|(i, t)| (i as f64, (t - first) as f64));
    let (mean_i, mean_t) = ((n - 1.0) / 2.0, points().map(|(_, t)| t).sum::<f64>() / n);
    let slope = points().map(|(i, t)| (i - mean_i) * (t - mean_t)).sum::<f64>()
        / points().map(|(i, _)| (i - mean_i).powi(2)).sum::<f64>();
    let off = |(i, t): (f64, f64)| (t - mean_t - slope * (i - mean_i)).abs();
    let worst = points().map(off).fold(0.0, f64::max);
    (128e6 / slope, spread, worst / 128.0)
}

/// Settings for a million steps a second: 1,280 steps a millimetre, pulses of half a microsecond.
pub const FAST: [&str; 5] = [
    "{spw:0,sv:0,4tr:1.25}",
    "{x:{vm:46875,fr:46875,jm:1e6,ac:20000}}",
    "{y:{vm:46875,fr:46875,jm:1e6,ac:20000}}",
    "{z:{vm:46875,fr:46875,jm:1e6,ac:20000}}",
    "{a:{am:1,vm:46875,fr:46875,jm:1e6,ac:20000}}",
];
