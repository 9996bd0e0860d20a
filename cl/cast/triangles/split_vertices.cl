// meaning: vertices in __local memory, normals in global memory: what the paper proposes as a next step
// read_from: global
// copied: vertices

#define SOURCE_SPACE __global
#define STAGE_VERTICES 1
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
