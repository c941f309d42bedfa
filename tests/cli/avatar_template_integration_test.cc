#include <filesystem>

#include "avatar/body/smpl/read.h"
#include "core/disk/files.h"
#include "tests/body/pickle_bytes.h"
#include "tests/body/small_smpl.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio {
namespace {

/// `avatar template` with these words, its result as JSON.
struct TemplateRun {
  int exit = -1;
  std::string err;
  nlohmann::json json;

  explicit TemplateRun(std::vector<std::string> words) {
    words.insert(words.begin(), {"avatar", "template", "--json"});
    const CliRun run = testing::RunCli(words);
    exit = run.exit, err = run.err + run.out, json = run.Json();
  }
};

std::string Pickle(const TempDir& folder) {
  WriteFileAtomic(folder / "model.pkl", body::pickle_bytes::DictOf(body::small_smpl::Model()));
  return folder / "model.pkl";
}

TEST(AvatarTemplate, PickleBecomesTheSameBody) {
  const TempDir folder;
  const std::string source = Pickle(folder), out = folder / "model.npz";
  const TemplateRun run({source, "--out", out});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.json["metrics"]["vertices"], 144);
  EXPECT_EQ(run.json["metrics"]["bones"], 24);
  EXPECT_EQ(run.json["metrics"]["shapes"].size(), 3u);
  EXPECT_EQ(run.json["metrics"]["pose_directions"], 207);
  EXPECT_EQ(run.json["metrics"]["roles"]["spine"], (std::vector<std::string>{"spine1", "spine2"}));
  EXPECT_EQ(run.json["metrics"]["roles"]["right forearm"], std::vector<std::string>{"right_elbow"});
  EXPECT_EQ(run.json["outputs"][0]["path"], out);
  const body::BodyTemplate from_pickle = body::ReadSmpl(source), converted = body::ReadSmpl(out);
  EXPECT_EQ(converted.vertices, from_pickle.vertices);
  EXPECT_EQ(converted.bone_heads, from_pickle.bone_heads);
  EXPECT_EQ(converted.shapes.vertices, from_pickle.shapes.vertices);
  EXPECT_EQ(converted.pose_directions, from_pickle.pose_directions);
  const TemplateRun again({out});
  EXPECT_EQ(again.exit, 0) << again.err;
  EXPECT_EQ(again.json["metrics"], run.json["metrics"]);
}

TEST(AvatarTemplate, NeverReplacesAFile) {
  const TempDir folder;
  const std::string source = Pickle(folder), out = folder / "model.npz";
  ASSERT_EQ(TemplateRun({source, "--out", out}).exit, 0);
  const std::string before = ReadFile(out);
  const TemplateRun again({source, "--out", out});
  EXPECT_EQ(again.exit, 2);
  EXPECT_THAT(again.err, HasSubstr("exists"));
  EXPECT_EQ(ReadFile(out), before);
  EXPECT_EQ(TemplateRun({out, "--out", out}).exit, 2) << "the source itself";
  std::filesystem::create_symlink("nowhere", folder / "link.npz");
  EXPECT_EQ(TemplateRun({source, "--out", folder / "link.npz"}).exit, 2);
}

TEST(AvatarTemplate, TellsOfOtherTemplatesAndDoesNotConvertThem) {
  const TempDir folder;
  const TemplateRun run({"mannequin"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.json["metrics"]["shapes"].size(), 0u);
  EXPECT_NEAR(run.json["metrics"]["height_m"].get<double>(), 1.75, 0.05);
  EXPECT_EQ(run.json["metrics"]["roles"]["head"].size(), 1u);
  const TemplateRun refused({"mannequin", "--out", folder / "a.npz"});
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.err, HasSubstr("another skeleton"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.npz"));
}

TEST(AvatarTemplate, MakeHuman) {
  MVS_NEEDS_DATA("makehuman_cc0");
  const TemplateRun run({testing::DataRoot() + "/makehuman_cc0"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.json["metrics"]["faces"], 26756);
  EXPECT_GT(run.json["metrics"]["shapes"].size(), 5u);
}

TEST(AvatarTemplate, WhatIsNoTemplateIsNamed) {
  const TempDir folder;
  WriteFileAtomic(folder / "bad.pkl", "cos\nsystem\n(S'touch ran'\ntR.");
  const TemplateRun run({folder / "bad.pkl", "--out", folder / "a.npz"});
  EXPECT_EQ(run.exit, 3);
  EXPECT_THAT(run.err, HasSubstr("os.system"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.npz"));
  const std::string source = Pickle(folder);
  EXPECT_EQ(TemplateRun({source, "--out", folder / "a.txt"}).exit, 2);
  EXPECT_EQ(TemplateRun({folder / "none.pkl"}).exit, 3);
}

}  // namespace
}  // namespace mvstudio
