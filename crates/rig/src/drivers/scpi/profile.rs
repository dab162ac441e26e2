/// How an instrument is spoken to: data, so that another one is another row.
///
/// In `configure` {range} is the largest reading of an exposure in the instrument's unit, {nplc} its time in periods of the
/// mains, {averages} the same in readings of `average_ms`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Its name in the rig file.
    pub name: &'static str,
    /// Parts of the answer to `*IDN?`, one of which must be there; none: any instrument is taken.
    pub identity: &'static [&'static str],
    /// Sent once after each connection.
    pub setup: &'static [&'static str],
    /// Sent before a reading where it differs from the last.
    pub configure: &'static str,
    /// Asks for one reading.
    pub read: &'static str,
    /// Periods of the mains that it can integrate over.
    pub nplc: [f64; 2],
    /// Time of one of its own readings of which it averages, ms; 0: it integrates over periods of the mains.
    pub average_ms: f64,
}

const KEITHLEY_6485: Profile = Profile {
    name: "keithley-6485",
    identity: &["6485"],
    setup: &[
        "*RST",
        "*CLS",
        "FORM:ELEM READ",
        "SYST:ZCH OFF",
        "SENS:CURR:RANG:AUTO OFF",
    ],
    configure: "SENS:CURR:RANG {range};:SENS:CURR:NPLC {nplc}",
    read: "READ?",
    nplc: [0.01, 50.0],
    average_ms: 0.0,
};

/// All of them; the last one has all its commands from the rig file.
pub(crate) const PROFILES: [Profile; 6] = [
    KEITHLEY_6485,
    Profile {
        name: "keithley-6487",
        identity: &["6487"],
        ..KEITHLEY_6485
    },
    Profile {
        name: "keithley-dmm6500",
        identity: &["DMM6500", "DMM7510"],
        setup: &["*RST", "*CLS", "SENS:FUNC \"CURR:DC\"", "SENS:CURR:RANG:AUTO OFF"],
        configure: "SENS:CURR:RANG {range};:SENS:CURR:NPLC {nplc}",
        nplc: [0.0005, 15.0],
        ..KEITHLEY_6485
    },
    Profile {
        name: "keithley-2000",
        identity: &["MODEL 2000", "MODEL 2010", "MODEL 2001"],
        setup: &[
            "*RST",
            "*CLS",
            "FORM:ELEM READ",
            "SENS:FUNC 'CURR:DC'",
            "SENS:CURR:DC:RANG:AUTO OFF",
        ],
        configure: "SENS:CURR:DC:RANG {range};:SENS:CURR:DC:NPLC {nplc}",
        nplc: [0.01, 10.0],
        ..KEITHLEY_6485
    },
    Profile {
        name: "thorlabs-pm100",
        identity: &["PM100", "PM101", "PM400"],
        setup: &["*CLS", "CONF:POW", "SENS:POW:RANG:AUTO OFF"],
        configure: "SENS:POW:RANG {range};:SENS:AVER:COUN {averages}",
        average_ms: 3.0,
        ..KEITHLEY_6485
    },
    Profile {
        name: "generic",
        identity: &[],
        setup: &[],
        configure: "",
        nplc: [0.0, 1e6],
        ..KEITHLEY_6485
    },
];
