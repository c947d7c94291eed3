//! How many cases the properties are tried with, and which.

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

/// A fixed set of cases, unless `PROPTEST_RNG_SEED` names others.
pub fn cases(count: u32) -> ProptestConfig {
    let wanted = std::env::var("KERF_CASES").ok().and_then(|n| n.parse().ok());
    let mut config = ProptestConfig::with_cases(wanted.unwrap_or(count));
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(2560);
    }
    config
}
