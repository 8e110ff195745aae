#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "base/sha256.hpp"
#include "o80/base/version.hpp"

namespace o80::test {
namespace {

namespace fs = std::filesystem;

std::string sha256_of_text(const std::string& text) {
  Sha256 hash;
  hash.add({reinterpret_cast<const std::byte*>(text.data()), text.size()});
  return hash.hex();
}

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(SourceHashTest, IsThatOfTheSourcesFromWhichTheLibraryWasBuilt) {
  const fs::path root = O80_TEST_SOURCE;
  std::set<std::string> paths;
  for (const char* folder : {"include/o80", "src"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension();
      const bool is_source = extension == ".hpp" || (extension == ".cpp" && folder[0] == 's');
      if (is_source) paths.insert(fs::relative(entry.path(), root).string());
    }
  }
  std::string listing;
  for (const std::string& path : paths)
    listing += sha256_of_text(content(root / path)) + "  " + path + "\n";

  EXPECT_EQ(source_hash(), sha256_of_text(listing));
}

}  // namespace
}  // namespace o80::test
