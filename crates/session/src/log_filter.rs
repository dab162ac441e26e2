use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;

/// What a program logs: what the variable `RUST_LOG` says, such as `warn` or `info,capture=debug`, else everything from
/// `default` on.
///
/// A text that is no such list counts as none.
pub fn log_filter(default: LevelFilter) -> Targets {
    let said = std::env::var("RUST_LOG").ok();
    let said = said.filter(|text| !text.trim().is_empty());
    said.and_then(|text| text.parse().ok())
        .unwrap_or_else(|| Targets::new().with_default(default))
}
