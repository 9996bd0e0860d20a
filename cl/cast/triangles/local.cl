// meaning: the whole scene copied to __local memory: the paper's optimisation 2
// read_from: global
// copied: scene

#define SOURCE_SPACE __global
#define STAGE_VERTICES 1
#define STAGE_NORMALS 1
#define STAGE_MATERIALS 1
#define STREAM_TILES 0
