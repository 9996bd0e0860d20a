// The address spaces of the triangles' corners, normals and materials, and a macro that copies them to __local memory.

#if STAGE_VERTICES
#define VERTEX_SPACE __local
#else
#define VERTEX_SPACE SOURCE_SPACE
#endif
#if STAGE_NORMALS
#define NORMAL_SPACE __local
#else
#define NORMAL_SPACE SOURCE_SPACE
#endif
#if STAGE_MATERIALS
#define MATERIAL_SPACE __local
#else
#define MATERIAL_SPACE SOURCE_SPACE
#endif

#define LOCAL_INDEX ((int)(get_local_id(1) * LOCAL_X + get_local_id(0)))

// Copies `rows` rows of `row` elements each. In the source, rows begin `stride` elements apart; in the target, the rows
// are contiguous. All work-items of the work-group must execute this macro, since they share the copying.
#define STAGE(target, source, rows, row, stride)                                    \
    for (int at = LOCAL_INDEX; at < (rows) * (row); at += LOCAL_X * LOCAL_Y)          \
        (target)[at] = (source)[at / (row) * (stride) + at % (row)];
