#version 460

layout(location = 0) flat in uint triangle_plus_one;

layout(location = 0) out uint id;

void main() {
    id = triangle_plus_one;
}
