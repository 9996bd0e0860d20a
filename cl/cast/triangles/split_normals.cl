// Where triangles are read from: normals copied to __local memory, vertices left in global.

#define SOURCE_SPACE __global
#define STAGE_VERTICES 0
#define STAGE_NORMALS 1
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
