#version 460
// One triangle that covers the attachments.

void main() {
    vec2 corner = vec2(float((gl_VertexIndex & 1) << 2), float((gl_VertexIndex & 2) << 1));
    gl_Position = vec4(corner - 1.0, 0.0, 1.0);
}
