#include "stages/study/study.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "report/page/value.h"
#include "report/study/study.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using report::Value;

/// Folders truth, a and b with images p0.png … of their own grey.
void PutImages(const TempDir& folder, int count) {
  for (const char* side : {"truth", "a", "b"}) {
    for (int i = 0; i < count; ++i) {
      dataset::WriteImage(Image(16, 16, 3, static_cast<uint8_t>(side[0] + i)),
                          folder / side + "/p" + std::to_string(i) + ".png");
    }
  }
}

StudyArguments Arguments(const TempDir& folder) {
  StudyArguments arguments;
  arguments.sides = {"ours=" + (folder / "a"), folder / "b" + "/"};
  arguments.truth = folder / "truth";
  arguments.title = "Who is right?";
  return arguments;
}

TEST(Study, PageAndKeyOfTwoFolders) {
  const TempDir folder;
  PutImages(folder, 3);
  const CommandResult result = RunStudy(Arguments(folder), folder / "out/study.html", 1);
  EXPECT_EQ(result.exit, kExitOk);
  EXPECT_TRUE(result.warnings.empty());
  EXPECT_EQ(result.metrics["questions"], 3);
  EXPECT_EQ(result.metrics["methods"], nlohmann::ordered_json::array({"ours", "b"}));
  ASSERT_EQ(result.outputs.size(), 2u);
  EXPECT_THAT(ReadFile(folder / "out/study.html"), HasSubstr("Who is right?"));
  const Value key = Value::Parse(ReadFile(folder / "out/study.key.json"), "key");
  EXPECT_EQ(key["sha256"].Text(), result.metrics["study"].get<std::string>());
  EXPECT_EQ(key["questions"].items().size(), 3u);
  StudyArguments fewer = Arguments(folder);
  fewer.images = 2;
  EXPECT_EQ(RunStudy(fewer, folder / "out/fewer.html", 1).metrics["questions"], 2);
}

TEST(Study, ImagesThatAreNotInAllFoldersAreCounted) {
  const TempDir folder;
  PutImages(folder, 3);
  std::filesystem::remove(folder / "b/p1.png");
  dataset::WriteImage(Image(16, 16, 3), folder / "a/q.png");
  const CommandResult result = RunStudy(Arguments(folder), folder / "study.html", 1);
  EXPECT_EQ(result.exit, kExitPartial);
  EXPECT_EQ(result.metrics["questions"], 2);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "STUDY-UNMATCHED");
  EXPECT_THAT(result.warnings[0].text, HasSubstr("2 images are not in all three folders; the first: p1"));
}

TEST(Study, WhatIsMissingIsNamedAndOthersFilesStay) {
  const TempDir folder;
  PutImages(folder, 1);
  const StudyArguments good = Arguments(folder);
  const auto refused = [&](const StudyArguments& arguments, const std::string& out) {
    return MessageOf<UsageError>([&] { RunStudy(arguments, out, 1); });
  };
  EXPECT_THAT(refused(good, ""), HasSubstr("option 'out'"));
  StudyArguments bad = good;
  bad.images = 0;
  EXPECT_THAT(refused(bad, folder / "s.html"), HasSubstr("option 'study-pictures'"));
  bad = good;
  bad.truth.clear();
  EXPECT_THAT(refused(bad, folder / "s.html"), HasSubstr("option 'truth'"));
  bad = good;
  bad.sides[1] = "theirs=" + (folder / "none");
  EXPECT_THAT(MessageOf<IoError>([&] { RunStudy(bad, folder / "s.html", 1); }), HasSubstr(folder / "none"));
  EXPECT_FALSE(std::filesystem::exists(folder / "s.html"));
  Put(folder / "s.key.json", "mine");
  EXPECT_THAT(refused(good, folder / "s.html"), HasSubstr("s.key.json"));
  EXPECT_EQ(ReadFile(folder / "s.key.json"), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder / "s.html"));
}

/// A file of answers: of `count` questions the first `ours` prefer the method "ours", which is always on the left.
void PutAnswers(const std::string& path, const std::vector<std::string>& methods, const std::string& rater, int ours,
                int count) {
  Value answers = Value::Array();
  for (int i = 0; i < count; ++i) {
    const std::string image = "p" + std::to_string(i);
    answers.Append(Value::Object()
                       .Set("picture", image)
                       .Set("seal", report::StudySeal("study", image, "ours"))
                       .Set("choice", i < ours ? "left" : "right"));
  }
  Put(path, Value::Object()
                .Set("schema", report::kStudyAnswersSchema)
                .Set("study", "study")
                .Set("methods", Value::Array().Append(methods[0]).Append(methods[1]))
                .Set("rater", rater)
                .Set("answers", answers)
                .Dump());
}

TEST(StudyAnswersTally, IsTheSameFromBothSides) {
  const TempDir folder;
  PutAnswers(folder / "1", {"ours", "theirs"}, "Ann", 8, 10);
  PutAnswers(folder / "2", {"theirs", "ours"}, "Ann", 8, 10);
  StudyArguments first, second;
  first.tally = {folder / "1"}, second.tally = {folder / "2"};
  const auto a = RunStudyTally(first).metrics["pooled"], b = RunStudyTally(second).metrics["pooled"];
  EXPECT_EQ(a["n"], 10);
  EXPECT_EQ(a["first"], 8);
  EXPECT_EQ(b["first"], 2);
  EXPECT_NEAR(a["share"].get<double>(), 0.8, 1e-15);
  EXPECT_NEAR(a["ci95"][0].get<double>(), 0.4901625, 1e-7);  // Brown, Cai and DasGupta, Statistical Science 2001
  EXPECT_NEAR(a["ci95"][1].get<double>(), 0.9433178, 1e-7);
  EXPECT_NEAR(a["share"].get<double>() + b["share"].get<double>(), 1, 1e-15);
  for (const int side : {0, 1}) EXPECT_NEAR(a["ci95"][side].get<double>() + b["ci95"][1 - side].get<double>(), 1, 1e-12);
  EXPECT_NEAR(a["p_value"].get<double>(), 112 / 1024.0, 1e-15);  // 2 (45 + 10 + 1) / 2^10
  EXPECT_EQ(a["p_value"], b["p_value"]);
  EXPECT_EQ(a["left"], b["left"]);
}

}  // namespace
}  // namespace mvstudio::stages
