// Where triangles are read from: vertices copied to __local memory, normals left in global: the paper's next step.

#define SOURCE_SPACE __global
#define STAGE_VERTICES 1
#define STAGE_NORMALS 0
#define STAGE_MATERIALS 0
#define STREAM_TILES 0
