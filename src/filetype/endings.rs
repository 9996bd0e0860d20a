//! Formats that are recognised by the extension of a file's name, if the contents of the file do not show its format.

use super::signatures::{CAD, CONVERT, EXPORT, OWN, POINTS, SURFACE};
use super::{Foreign, unpacked_name};
use std::path::Path;

/// For each format: its extensions, its name, and advice for a user who has a file of this format.
const ENDINGS: &[(&[&str], &str, &str)] = &[
    (&["xyz", "xyzrgb"], "a list of points or atoms (XYZ)", POINTS),
    (&["pts", "ptx", "asc", "pcd", "las", "laz", "e57"], "a point cloud", POINTS),
    (&["csv", "tsv"], "a table (CSV), such as a list of points", POINTS),
    (
        &["splat", "ksplat", "spz"],
        "a scene of Gaussian splats",
        "export the splats as a mesh, from a program for splats",
    ),
    (&["off"], "an OFF mesh", EXPORT),
    (&["3ds"], "a 3DS scene", EXPORT),
    (&["fbx"], "an FBX scene", EXPORT),
    (&["blend"], "a Blender file", EXPORT),
    (&["dae"], "a COLLADA scene", EXPORT),
    (&["x3d", "wrl", "vrml"], "a VRML or X3D scene", EXPORT),
    (&["usd", "usda", "usdc", "usdz"], "a USD scene", EXPORT),
    (&["abc"], "an Alembic scene", EXPORT),
    (&["3mf"], "a 3MF model", EXPORT),
    (&["amf"], "an AMF model", EXPORT),
    (&["dxf", "dwg"], "a drawing (DXF or DWG)", EXPORT),
    (&["max"], "a 3ds Max scene", OWN),
    (&["c4d"], "a Cinema 4D scene", OWN),
    (&["ma", "mb"], "a Maya scene", OWN),
    (&["skp"], "a SketchUp model", OWN),
    (&["3dm"], "a Rhino model", OWN),
    (&["lwo", "lws"], "a LightWave object", OWN),
    (&["lxo"], "a Modo scene", OWN),
    (&["bgeo", "hip", "hipnc"], "a Houdini file", OWN),
    (&["ac", "ac3d"], "an AC3D model", OWN),
    (&["x", "md2", "md3", "md5mesh", "ms3d", "b3d", "nff", "cob"], "a mesh of another format", OWN),
    (&["scad"], "an OpenSCAD program", "export the model as STL, with OpenSCAD"),
    (&["stp", "step", "p21"], "a STEP model", CAD),
    (&["igs", "iges"], "an IGES model", CAD),
    (&["brep", "brp", "fcstd"], "a FreeCAD model", CAD),
    (&["sat", "sab", "x_t", "x_b", "jt"], "a CAD model", CAD),
    (&["sldprt", "sldasm", "ipt", "iam", "prt", "catpart", "catproduct"], "a CAD model", CAD),
    (
        &["msh", "mesh", "meshb", "node", "ele", "inp", "bdf", "nas", "unv", "cgns"],
        "a mesh for simulations",
        CONVERT,
    ),
    (&["geo"], "a Gmsh or Houdini geometry", "make a mesh (STL) of the geometry, with Gmsh or Houdini"),
    (&["vtk", "vtp", "vtu", "vts", "vti", "vtr", "pvd"], "a VTK file", CONVERT),
    (&["nii", "mrc", "nrrd", "nhdr", "mha", "mhd", "dcm", "vdb", "raw"], "a volume", SURFACE),
    (
        &["pdb", "cif", "mol", "mol2", "sdf"],
        "a molecule",
        "export the molecule's surface as OBJ, with PyMOL or ChimeraX",
    ),
];

/// Returns the format that a name's extension (before a final `.gz`) stands for, if raycl does not read this
/// format. Returns `None` for an unknown extension, and for an extension of a format that raycl reads.
pub(super) fn foreign(path: &Path) -> Option<Foreign> {
    let name = unpacked_name(path);
    let ending = name.extension()?.to_str()?.to_ascii_lowercase();
    let of_ending = ENDINGS.iter().find(|(endings, ..)| endings.contains(&ending.as_str()));
    of_ending.map(|&(_, name, remedy)| Foreign { name, remedy })
}

#[cfg(test)]
mod tests {
    use super::super::MeshFormat;
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_extension_stands_for_one_format_that_raycl_does_not_read() {
        let all = || ENDINGS.iter().flat_map(|(endings, ..)| *endings);
        assert_eq!(all().collect::<HashSet<_>>().len(), all().count());
        for ending in all() {
            let named = |name: String| (foreign(Path::new(&name)), MeshFormat::from_ending(Path::new(&name)));
            for name in [format!("a.{ending}"), format!("A.{}.gz", ending.to_uppercase())] {
                assert!(matches!(named(name), (Some(_), None)), "{ending}");
            }
        }
        for name in ["a", "a.toml", "a.obj", "xyz", ".gz"] {
            assert_eq!(foreign(Path::new(name)), None, "{name}");
        }
    }
}
