// meaning: normals in __local memory, vertices in global memory: the reverse of split-vertices
// read_from: global
// copied: normals

#define SOURCE_SPACE __global
#define STAGE_VERTICES 0
#define STAGE_NORMALS 1
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
