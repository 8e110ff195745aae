#include "memory/os/mapping.hpp"

#include <sys/mman.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "o80/base/error.hpp"

namespace o80 {

Mapping::Mapping(int descriptor, std::size_t bytes, Protection protection, Faults faults)
    : bytes_(bytes) {
  const int access = protection == Protection::read ? PROT_READ : PROT_READ | PROT_WRITE;
  const int flags = MAP_SHARED | (faults == Faults::now ? MAP_POPULATE : 0);
  void* address = mmap(nullptr, bytes, access, flags, descriptor, 0);
  if (address == MAP_FAILED)
    throw SegmentError("cannot map " + std::to_string(bytes) +
                       " bytes of shared memory: " + std::strerror(errno));
  data_ = static_cast<std::byte*>(address);
}

Mapping::Mapping(Mapping&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

Mapping& Mapping::operator=(Mapping&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

Mapping::~Mapping() {
  if (data_ != nullptr) munmap(data_, bytes_);
}

void Mapping::make_writable(std::byte* base, int descriptor, std::uint64_t offset,
                            std::size_t bytes) {
  void* address =
      mmap(base + offset, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_FIXED | MAP_POPULATE,
           descriptor, static_cast<off_t>(offset));
  if (address == MAP_FAILED)
    throw SegmentError(std::string("cannot map shared memory for writing: ") +
                       std::strerror(errno));
}

}  // namespace o80
