#include "core/hash/sha256.h"

#include <algorithm>
#include <string>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/hash/sha256_blocks.h"
#include "core/random.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

/// Messages and digests of FIPS 180-4's examples and NIST's CAVP vectors.
TEST(Sha256, FipsVectors) {
  const std::pair<std::string, std::string> vectors[] = {
      {"", "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"},
      {"abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"},
      {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
       "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"},
      {"abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqrlmnopqrsmnopqrstnopqrstu",
       "cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1"},
      {std::string(1000000, 'a'), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"}};
  for (const auto& [message, digest] : vectors) EXPECT_EQ(Sha256Hex(message.data(), message.size()), digest);
}

TEST(Sha256, PiecesOfAnySizeGiveTheSame) {
  std::string message;
  for (int i = 0; i < 1000; ++i) message += static_cast<char>(i * 37);
  for (size_t length = 0; length < 200; ++length) {
    const std::string expected = Sha256Hex(message.data(), length);
    for (const size_t piece : {1, 3, 55, 63, 64, 65}) {
      Sha256 hash;
      for (size_t at = 0; at < length; at += piece) hash.Update(message.data() + at, std::min(piece, length - at));
      ASSERT_EQ(hash.HexDigest(), expected) << length << " in pieces of " << piece;
    }
  }
}

/// FIPS 180-4's example of one block, "abc" with its padding, through either function.
TEST(Sha256, BothCompressionFunctionsKnowTheExample) {
  std::array<uint8_t, 64> block = {'a', 'b', 'c', 0x80};
  block[63] = 24;
  const internal::Sha256State start = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                       0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  const internal::Sha256State expected = {0xba7816bf, 0x8f01cfea, 0x414140de, 0x5dae2223,
                                          0xb00361a3, 0x96177a9c, 0xb410ff61, 0xf20015ad};
  internal::Sha256State state = start;
  internal::CompressPortable(state, block.data(), 1);
  EXPECT_EQ(state, expected);
  if (!internal::HasShaInstructions()) GTEST_SKIP() << "this machine has no instructions for SHA-256";
  state = start;
  internal::CompressWithInstructions(state, block.data(), 1);
  EXPECT_EQ(state, expected);
}

TEST(Sha256, BothCompressionFunctionsAgreeOnRandomBlocksAtAnyAddress) {
  if (!internal::HasShaInstructions()) GTEST_SKIP() << "this machine has no instructions for SHA-256";
  Rng rng(7);
  for (int round = 0; round < 300; ++round) {
    const size_t count = static_cast<size_t>(rng.Index(9)), shift = static_cast<size_t>(rng.Index(16));
    std::vector<uint8_t> bytes(64 * count + shift);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(rng.Next());
    internal::Sha256State portable, hardware;
    for (uint32_t& word : portable) word = static_cast<uint32_t>(rng.Next());
    hardware = portable;
    internal::CompressPortable(portable, bytes.data() + shift, count);
    internal::CompressWithInstructions(hardware, bytes.data() + shift, count);
    ASSERT_EQ(portable, hardware) << count << " blocks";
  }
}

TEST(Sha256, AFolderHasNoDigest) {
  const testing::TempDir folder;
  EXPECT_THROW(Sha256File(folder.path()), IoError);
}

TEST(Sha256, FileMatchesMemory) {
  const testing::TempDir folder;
  const std::string content(3000001, '\x7f');
  WriteFileAtomic(folder / "big", content);
  EXPECT_EQ(Sha256File(folder / "big"), Sha256Hex(content.data(), content.size()));
  EXPECT_THROW(Sha256File(folder / "none"), IoError);
}

}  // namespace
}  // namespace mvstudio
