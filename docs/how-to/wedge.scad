// A wedge that tilts a flat specimen about the line in which the arms' plane meets the stage; docs/how-to/use-a-wedge.md.
// Print one of 20 and one of 45 degrees, in matt black.

// By how much it tilts, degrees; what --wedge is told.
tilt_deg = 20;
// Length and width, mm: at least those of the specimen's holder.
size_mm = 50;
// Thickness of the thin edge, mm.
thin_mm = 3;
// The lip that keeps the specimen from sliding: thickness, and height above the thin edge, mm.
lip_mm = 2;
// Width of the notches that stand in the arms' plane, mm.
notch_mm = 1.5;

thick_mm = thin_mm + size_mm * tan(tilt_deg);
middle_mm = (thin_mm + thick_mm) / 2;
echo(str("Lower the stage by ", middle_mm, " mm, so that the middle of the specimen stays where the arms' axes meet."));

// x lies in the arms' plane; the specimen's normal leans towards +y.
difference() {
    union() {
        rotate([90, 0, 90])
            linear_extrude(size_mm, center = true)
                polygon([
                    [-size_mm / 2, 0],
                    [size_mm / 2, 0],
                    [size_mm / 2, thin_mm],
                    [-size_mm / 2, thick_mm]
                ]);
        translate([-size_mm / 2, size_mm / 2, 0])
            cube([size_mm, lip_mm, thin_mm + lip_mm]);
    }
    for (end = [-1, 1])
        translate([end * size_mm / 2 - notch_mm / 2, -notch_mm / 2, -1])
            cube([notch_mm, notch_mm, thick_mm + 2]);
}
