// Memory as on a small machine: MRPT's readers ask for what a damaged length says, up to 4 GB at
// once, before they read. The sanitizers cannot let that fail as it does in the program.
#include <cstdlib>
#include <new>

namespace {
constexpr std::size_t kMost = std::size_t{256} << 20;
}

void* operator new(std::size_t size) {
    void* memory = size > kMost ? nullptr : std::malloc(size > 0 ? size : 1);
    if (!memory) throw std::bad_alloc();
    return memory;
}
void* operator new[](std::size_t size) {
    return operator new(size);
}
void operator delete(void* memory) noexcept {
    std::free(memory);
}
void operator delete[](void* memory) noexcept {
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
    std::free(memory);
}
void operator delete[](void* memory, std::size_t) noexcept {
    std::free(memory);
}
