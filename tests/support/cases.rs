//! The number and the choice of the random cases that properties are tested with.

use proptest::prelude::ProptestConfig;
use proptest::test_runner::RngSeed;

/// Returns a configuration for a fixed set of cases, unless `PROPTEST_RNG_SEED` selects others.
pub fn cases(count: u32) -> ProptestConfig {
    let wanted = std::env::var("KERF_CASES").ok().and_then(|n| n.parse().ok());
    let mut config = ProptestConfig::with_cases(wanted.unwrap_or(count));
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(2560);
    }
    config
}
