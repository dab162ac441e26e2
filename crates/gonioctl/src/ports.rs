use serde_json::json;

use crate::document;

/// Lists the serial ports of this machine.
///
/// # Errors
/// The system does not say.
pub(crate) fn ports(as_json: bool) -> anyhow::Result<()> {
    let ports = rig::ports()?;
    if as_json {
        return Ok(document::PORTS.print(&json!({ "ports": ports }))?);
    }
    if ports.is_empty() {
        terminal::say("no serial port here");
    }
    for port in ports {
        let usb = port.usb.as_ref();
        let product = usb.and_then(|usb| usb.product.as_deref()).unwrap_or_default();
        terminal::line(format_args!("{}  {product}", port.path.display()))?;
    }
    Ok(())
}
