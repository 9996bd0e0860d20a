// Each work-item computes the record of one triangle: the row for the ray-triangle test. The host runs the kernel once
// per scene. Records are in the mesh's order or, with a tree, in leaf order.
__kernel void prepare_records(PREPARE_RECORDS_PARAMETERS) {
    const int at = get_global_id(0);
    if (at >= triangle_count) return;
#if TREE
    Tree tree;
    tree.leaves = leaves;
    const Row row = row_of(leaf_corners(&tree, at));
#else
    Geometry geometry;
    BIND_GEOMETRY(geometry)
    const Row row = row_of(corners(&geometry, at));
#endif
    // The record is stored at the triangle's index in the mesh or, with a tree, in leaf order. A traversal knows the
    // triangle's index, so a test finds the record without reading another index.
    __global ROW_UNIT *record = (__global ROW_UNIT *)records + ROW_UNITS * (size_t)at;
    STORE_ROW(row, record)
}
