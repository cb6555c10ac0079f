// Room for large outputs. Half the time of filling fresh memory goes into the system's handing it over page by page, so blocks that were let
// go are kept for the next run: two, since a run asks for temperatures and sensitivities.
#include "bindings/bind.hpp"

namespace thermid {

namespace {

constexpr size_t SMALLEST = size_t(1) << 22, LARGEST = size_t(1) << 28;  // of a block that is kept [bytes]

// A block is an array of numpy, which asks the system for large pages. All of this happens under the interpreter's lock.
struct Block {
    nb::object array;
    size_t bytes = 0;
    double* data = nullptr;
};

std::vector<Block>& kept() {
    static auto* blocks = [] {
        auto* made = new std::vector<Block>;  // never destroyed: the interpreter may have ended by then
        made->reserve(2);
        return made;
    }();
    return *blocks;
}

void let_go(void* p) noexcept {
    const std::unique_ptr<Block> block(static_cast<Block*>(p));
    if (kept().size() == 2) kept().erase(kept().begin());
    kept().push_back(std::move(*block));
}

Block fresh(size_t count) {
    nb::object array = nb::module_::import_("numpy").attr("empty")(count);
    double* data = nb::cast<nb::ndarray<double, nb::c_contig, nb::device::cpu>>(array).data();
    return {std::move(array), count * sizeof(double), data};
}

}  // namespace

std::pair<nb::object, double*> room(nb::tuple shape) {
    std::vector<size_t> sizes;
    size_t count = 1;
    for (nb::handle h : shape) count *= sizes.emplace_back(nb::cast<size_t>(h));
    const size_t bytes = count * sizeof(double);
    if (bytes < SMALLEST || bytes > LARGEST) {
        const Block block = fresh(count);
        return {block.array.attr("reshape")(shape), block.data};
    }
    // Large enough, but not so large that most of it would lie idle.
    const auto fits = [&](const Block& b) { return b.bytes >= bytes && b.bytes / 2 <= bytes; };
    const auto found = std::find_if(kept().begin(), kept().end(), fits);
    auto block = std::make_unique<Block>();
    if (found != kept().end()) {
        *block = std::move(*found);
        kept().erase(found);
    } else {
        *block = fresh(count);
    }
    double* data = block->data;
    nb::capsule owner(block.release(), let_go);
    return {nb::cast(nb::ndarray<nb::numpy, double>(data, sizes.size(), sizes.data(), owner)), data};
}

}  // namespace thermid
