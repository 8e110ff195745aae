#include "runtime/journal/provenance_bytes.hpp"

#include <cstdint>
#include <string>

#include "base/little_endian.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr std::uint64_t kProvenanceMagic = 0x6E65'766F'7250'3038;  // "80Proven"
constexpr std::uint32_t kMaxOfAKind = 4096;                        // options or files

/// Visits all parts in the order in which they stand in the bytes.
template <class ProvenanceLike, class Visit>
void each_part(ProvenanceLike& provenance, Visit&& visit) {
  visit(provenance.wall_clock_offset);
  visit(provenance.robot);
  visit(provenance.library);
  visit(provenance.library_sha256);
  visit(provenance.built_with);
  visit(provenance.options);
  visit(provenance.run_options);
  visit(provenance.files);
  visit(provenance.version);
  visit(provenance.source_hash);
  visit(provenance.motion_rules);
}

class Writer {
 public:
  void operator()(std::uint64_t number) { to_.u64(number); }
  void operator()(std::int64_t number) { to_.u64(number); }
  void operator()(const std::string& text) {
    to_.u32(text.size());
    to_.bytes(std::as_bytes(std::span(text)));
  }
  void operator()(const std::pair<std::string, std::string>& option) {
    (*this)(option.first);
    (*this)(option.second);
  }
  void operator()(const Provenance::File& file) {
    (*this)(file.option);
    (*this)(file.path);
    (*this)(file.sha256);
  }
  template <class Each>
  void operator()(const std::vector<Each>& all) {
    to_.u32(all.size());
    for (const Each& each : all) (*this)(each);
  }
  std::vector<std::byte> bytes;

 private:
  LittleEndianWriter to_{bytes};
};

class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : from_(bytes) {}
  void operator()(std::uint64_t& number) { from_.u64(number); }
  void operator()(std::int64_t& number) { from_.u64(number); }
  void operator()(std::string& text) {
    std::uint32_t size = 0;
    from_.u32(size);
    const std::span<const std::byte> found = from_.bytes(size);
    if (!found.empty()) text.assign(reinterpret_cast<const char*>(found.data()), size);
  }
  void operator()(std::pair<std::string, std::string>& option) {
    (*this)(option.first);
    (*this)(option.second);
  }
  void operator()(Provenance::File& file) {
    (*this)(file.option);
    (*this)(file.path);
    (*this)(file.sha256);
  }
  template <class Each>
  void operator()(std::vector<Each>& all) {
    std::uint32_t count = 0;
    from_.u32(count);
    if (count > kMaxOfAKind) fail();
    for (std::uint32_t i = 0; i < count; ++i) (*this)(all.emplace_back());
  }
  bool is_at_end() const { return !from_.failed() && from_.left() == 0; }

  [[noreturn]] static void fail() {
    throw SegmentError("the record of how the robot was started is damaged");
  }

 private:
  LittleEndianReader from_;
};

}  // namespace

std::vector<std::byte> to_bytes(const Provenance& provenance) {
  for (const std::size_t count :
       {provenance.options.size(), provenance.run_options.size(), provenance.files.size()}) {
    if (count > kMaxOfAKind)
      throw InvalidArgument("a robot can have at most " + std::to_string(kMaxOfAKind) +
                            " options, got " + std::to_string(count));
  }
  Writer write;
  write(kProvenanceMagic);
  each_part(provenance, write);
  return write.bytes;
}

Provenance provenance_from_bytes(std::span<const std::byte> bytes) {
  Reader read(bytes);
  std::uint64_t magic = 0;
  read(magic);
  if (magic != kProvenanceMagic) Reader::fail();
  Provenance provenance;
  each_part(provenance, read);
  if (!read.is_at_end()) Reader::fail();
  return provenance;
}

}  // namespace o80
