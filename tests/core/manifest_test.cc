#include "core/disk/manifest.h"

#include <nlohmann/json.hpp>
#include <string>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio {
namespace {

const std::string kDigest(64, 'a'), kOther(64, 'b');

Manifest Example() {
  Manifest manifest;
  manifest.command = "dataset build", manifest.version = "0.1.0";
  ManifestEntry& replaced = manifest.files["a.csv"];
  replaced.now.size = 12, replaced.now.sha256 = kDigest, replaced.by = "report";
  replaced.before.emplace();
  replaced.before->size = 3, replaced.before->sha256 = kOther;
  manifest.files["pictures/"];
  ManifestEntry& odd = manifest.files["pictures/\"quoted\\ \x01 \xff \xc3\xa4.png"];
  odd.now.size = uint64_t{1} << 60, odd.now.sha256 = kOther;
  return manifest;
}

TEST(ManifestText, IsJsonAndReadsBack) {
  const Manifest manifest = Example();
  const std::string text = ManifestToJsonText(manifest);
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  Manifest plain = manifest;
  plain.files.erase(std::prev(plain.files.end()));
  EXPECT_EQ(nlohmann::json::parse(ManifestToJsonText(plain))["files"].size(), 2u);
  const Manifest again = ManifestFromJsonText(text, "m");
  EXPECT_EQ(again.command, manifest.command);
  EXPECT_EQ(again.version, manifest.version);
  EXPECT_TRUE(again.whole);
  ASSERT_EQ(again.files.size(), manifest.files.size());
  for (const auto& [path, entry] : manifest.files) {
    ASSERT_TRUE(again.files.count(path)) << path;
    EXPECT_TRUE(again.files.at(path).now == entry.now) << path;
    EXPECT_EQ(again.files.at(path).before.has_value(), entry.before.has_value());
    EXPECT_EQ(again.files.at(path).by, entry.by);
  }
  EXPECT_EQ(ManifestToJsonText(again), text);
}

TEST(ManifestText, IsRefusedWhenCutOrWhenItNamesWhatIsOutside) {
  const std::string text = ManifestToJsonText(Example());
  for (size_t cut = 0; cut + 1 < text.size(); ++cut) {
    EXPECT_THROW(ManifestFromJsonText(text.substr(0, cut), "m"), FormatError) << cut;
  }
  for (const char* name : {"/etc/passwd", "../mine", "a/../../mine", "a//b", "./a", "", "/"}) {
    Manifest bad;
    bad.files["x"].now.sha256 = kDigest;
    std::string line = ManifestToJsonText(bad);
    line.replace(line.find("\"x\""), 3, "\"" + std::string(name) + "\"");
    EXPECT_THROW(ManifestFromJsonText(line, "m"), FormatError) << name;
  }
}

TEST(FilesInTheWay, AreThoseThatNoManifestListsAsTheyAre) {
  const TempDir root;
  WriteFileAtomic(root / "run/ours.csv", "x");
  {
    AtomicFolder dataset(root / "run/dataset", false);
    WriteFileAtomic(dataset.work_path() + "/images/a.png", "x");
    dataset.Commit();
  }
  EXPECT_TRUE(FilesInTheWay(root / "run").empty());
  EXPECT_TRUE(FilesInTheWay(root / "nothing").empty());
  Put(root / "run/dataset/images/b.png", "mine");
  Put(root / "run/ours.csv", "edited");
  const std::vector<std::string> expected = {root / "run/dataset/images/b.png", root / "run/ours.csv"};
  EXPECT_EQ(FilesInTheWay(root / "run"), expected);
}

TEST(FilesInTheWay, AManifestThatIsDamagedMakesNothingOurs) {
  const TempDir root;
  WriteFileAtomic(root / "run/ours.csv", "x");
  const std::string manifest = root / "run/.mvstudio.json";
  std::string text = ReadFile(manifest);
  Put(manifest, text.substr(0, text.size() / 2));
  EXPECT_EQ(FilesInTheWay(root / "run").size(), 2u);
  EXPECT_THROW(WriteFileAtomic(root / "run/ours.csv", "y"), Error);
  EXPECT_EQ(ReadFile(root / "run/ours.csv"), "x");
}

TEST(WriterOf, NamesTheCommand) {
  const TempDir root;
  SetWriterName("calibrate", "1");
  WriteFileAtomic(root / "run/calibration.json", "x");
  SetWriterName("report", "1");
  WriteFileAtomic(root / "run/report.html", "x");
  SetWriterName("", "");
  EXPECT_EQ(WriterOf(root / "run/calibration.json"), "calibrate");
  EXPECT_EQ(WriterOf(root / "run/report.html"), "report");
  EXPECT_EQ(WriterOf(root / "run/other"), "");
}

}  // namespace
}  // namespace mvstudio
