use serde::Deserialize;
use utoipa::ToSchema;
use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::openapi::{Ref, RefOr};

/// A job file in JSON, with the keys that config/jobs/quickstart.toml explains.
///
/// Only the OpenAPI document is made of it: what a job file may say is decided where TOML is read.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
pub(crate) struct JobFile {
    /// What lies on the stage, in your own words: a name, or a table that says more.
    #[schema(schema_with = name_or_table)]
    specimen: Option<SpecimenTable>,
    /// Who measures, and what for.
    #[serde(default)]
    run: RunTable,
    /// Whether it lies on the stage already; otherwise someone must say so before the job starts.
    #[serde(default)]
    on_stage: bool,
    /// Formats in which the result is written too, each once.
    #[serde(default)]
    formats: Vec<FormatName>,
    /// Plane sweeps, at least one; a job with a target or a budget may leave them to the program.
    #[schema(max_items = 12)]
    #[serde(default)]
    plane: Vec<PlaneTable>,
    /// Lines along which both arms move.
    #[schema(max_items = 12)]
    #[serde(default)]
    leg: Vec<LegTable>,
    /// Legs that together cover the plane of the arms.
    snake: Option<SnakeTable>,
    /// The mirror arc.
    #[serde(default)]
    arc: ArcTable,
    /// How the BRDF is made of the readings.
    #[serde(default)]
    reconstruction: ReconstructionTable,
    /// What will be looked at; everything unless given.
    scene: Option<SceneTable>,
    /// How the sweeps are run, and when to stop.
    #[serde(default)]
    sweep: SweepTable,
}

/// What lies on the stage.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
pub(crate) struct SpecimenTable {
    /// Its name.
    #[serde(default)]
    name: String,
    /// Its number in whatever list it stands.
    #[schema(max_length = 200)]
    #[serde(default)]
    id: String,
    /// What it is made of.
    #[schema(max_length = 200)]
    #[serde(default)]
    material: String,
    /// Words under which it is to be found again, each of 1 … 50 characters.
    #[schema(max_items = 20)]
    #[serde(default)]
    tags: Vec<String>,
    /// Anything else.
    #[schema(max_length = 10_000)]
    #[serde(default)]
    notes: String,
}

/// A specimen is a name or a table.
fn name_or_table() -> RefOr<Schema> {
    let about = "What lies on the stage, in your own words: a name, or a table that says more.";
    let either = OneOfBuilder::new()
        .item(ObjectBuilder::new().schema_type(Type::String))
        .item(Ref::from_schema_name("SpecimenTable"))
        .description(Some(about));
    either.into()
}

/// Who measures, and what for.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct RunTable {
    /// Who measures.
    #[schema(max_length = 200)]
    #[serde(default)]
    operator: String,
    /// What it is measured for.
    #[schema(max_length = 200)]
    #[serde(default)]
    project: String,
}

/// One plane sweep.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct PlaneTable {
    /// Where the sensor stands, degrees from the normal.
    #[schema(minimum = 0, maximum = 85)]
    theta_r_deg: f64,
    /// Readings over both sides of the mirror direction.
    #[schema(minimum = 1, maximum = 2000)]
    readings: u32,
    /// How d_p is distributed.
    #[serde(default)]
    distribution: DistributionName,
}

/// A line in half and difference angle, along which both arms move: the light at half − difference, the sensor at half +
/// difference.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct LegTable {
    /// Half angle at either end, degrees.
    #[schema(min_items = 2, max_items = 2)]
    half_deg: Vec<f64>,
    /// Difference angle at either end, degrees.
    #[schema(min_items = 2, max_items = 2)]
    difference_deg: Vec<f64>,
    /// Readings along it; as many as a flight at the arms' own speed can take unless given.
    #[schema(minimum = 1, maximum = 2000)]
    readings: Option<u32>,
}

/// Legs that together cover the plane of the arms.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct SnakeTable {
    /// How many: 3, 6 or 10.
    #[schema(minimum = 3, maximum = 10)]
    legs: u8,
}

/// The mirror arc.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct ArcTable {
    /// Readings along the arc.
    #[schema(minimum = 1, maximum = 2000)]
    readings: u32,
    /// Deviation from the mirror direction that the arc keeps.
    #[schema(minimum = -1, maximum = 1)]
    #[serde(default)]
    offset: f64,
}

/// How the BRDF is made of the readings.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct ReconstructionTable {
    /// Which model.
    #[serde(default)]
    model: ModelName,
}

/// What will be looked at.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct SceneTable {
    /// Zenith angles of the light, least and largest, degrees, 0 … 90.
    #[schema(min_items = 2, max_items = 2)]
    theta_i_deg: Option<Vec<f64>>,
    /// The same of the viewer.
    #[schema(min_items = 2, max_items = 2)]
    theta_o_deg: Option<Vec<f64>>,
    /// Instead of either range: cells of a histogram of directions, each with the light's zenith angle from … to, the
    /// viewer's from … to, degrees, and how often it is looked at.
    #[schema(min_items = 1)]
    directions: Option<Vec<[f64; 5]>>,
    /// Share of the weight of all cells that those which are kept have at least, the heaviest first; 1 unless given.
    #[schema(minimum = 0.01, maximum = 1)]
    share: Option<f64>,
    /// Channels; all unless given.
    #[schema(min_items = 1)]
    channels: Option<Vec<ChannelName>>,
}

/// How the sweeps are run, and when to stop.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "describes, never holds")]
struct SweepTable {
    /// Whether the arms stop for each reading.
    #[serde(default)]
    mode: ModeName,
    /// How often a flight passes each sweep.
    #[schema(minimum = 1, maximum = 2)]
    passes: Option<u8>,
    /// Error that is good enough, MALE.
    #[schema(minimum = 0.00001, maximum = 1)]
    target_male: Option<f64>,
    /// Rig seconds that the run may take.
    #[schema(minimum = 1, maximum = 86400)]
    budget_s: Option<f64>,
}

/// A channel of the photometer.
#[derive(Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum ChannelName {
    R,
    G,
    B,
}

/// Whether the arms stop for each reading.
#[derive(Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum ModeName {
    #[default]
    Step,
    Fly,
}

/// A file format.
#[derive(Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
enum FormatName {
    Merl,
    CsvLong,
    RglRgb,
    RglSpectral,
    Astm,
    Zemax,
    Ssdd,
    PabOpto,
    Exr,
    ExrHalfDifference,
    Materialx,
    Gltf,
}

/// How d_p is distributed.
#[derive(Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum DistributionName {
    #[default]
    Capped,
    Paper,
    Uniform,
    Lobe,
}

/// A reconstruction model.
#[derive(Default, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum ModelName {
    #[default]
    Separable,
    Reciprocal,
    Planes,
    Bivariate,
    Auto,
}
