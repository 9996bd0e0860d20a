// meaning: vertices in __local memory, normals in global memory: the next step that the paper proposes
// read_from: global
// copied: vertices

#define SOURCE_SPACE __global
#define STAGE_VERTICES 1
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
