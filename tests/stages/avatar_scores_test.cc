#include "stages/study/avatar_scores.h"

#include <filesystem>

#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using report::Value;

/// SHA-256 of {"crop":{"fill":0.97,"size_px":128},"name":"x"}, by Python's hashlib.
constexpr char kDigest[] = "9829c5110b4f14946a71f93676eb77159b9f954af96c0561d923b36a91115ad6";
constexpr char kBody[] = R"({ "name": "x", "crop": {"size_px": 128, "fill": 0.97} })";

std::string ProtocolJson(const std::string& body, const std::string& digest) {
  return R"({"schema": "mvstudio.avatar-protocol/1", "sha256": ")" + digest + R"(", "protocol": )" + body +
         R"(, "splits": {"easy": {"pictures": 3, "sha256": "s"}}})";
}

ScoreProtocol Protocol(const std::string& path, const std::string& body) {
  return {path, "", Value::Parse(body, path), Value()};
}

/// Where the error of a file is.
template <class F>
std::string PlaceInError(F&& f) {
  try {
    f();
  } catch (const FormatError& error) {
    return error.where();
  }
  return "no FormatError";
}

TEST(AvatarScores, LabelsAreCutOffButNotFromFoldersThatHaveAnEqualsSign) {
  const TempDir folder;
  std::filesystem::create_directories(folder / "size=128");
  const std::string run = folder / "size=128";
  using Pair = std::pair<std::string, std::string>;
  EXPECT_EQ(SplitLabel("runs/a"), Pair("", "runs/a"));
  EXPECT_EQ(SplitLabel("ours=runs/a=b"), Pair("ours", "runs/a=b"));
  EXPECT_EQ(SplitLabel(run), Pair("", run));
  EXPECT_EQ(SplitLabel("ours=" + run), Pair("ours", run));
  EXPECT_EQ(SplitLabel(folder / "size=64"), Pair(folder / "size", "64")) << "there is no such folder";
}

TEST(AvatarScores, TheDigestIsOfSortedKeysWithoutBlanks) {
  const TempDir folder;
  Put(folder / "protocol.json", ProtocolJson(kBody, kDigest));
  const ScoreProtocol protocol = ReadScoreProtocol(folder.path());
  EXPECT_EQ(protocol.sha256, kDigest);
  EXPECT_EQ(protocol.path, folder / "protocol.json");
  EXPECT_EQ(protocol.body["crop"]["size_px"].Number(), 128);
  EXPECT_EQ(protocol.splits["easy"]["sha256"].Text(), "s");
}

TEST(AvatarScores, EditedAndForeignProtocolsAreRefusedWithThePlace) {
  const TempDir folder;
  EXPECT_THAT(MessageOf<IoError>([&] { ReadScoreProtocol(folder.path()); }), HasSubstr("mvstudio avatar eval"));
  const auto place_of = [&](const std::string& text) {
    Put(folder / "protocol.json", text);
    return PlaceInError([&] { ReadScoreProtocol(folder.path()); });
  };
  EXPECT_EQ(place_of(ProtocolJson(R"({"name": "y", "crop": {"size_px": 128, "fill": 0.97}})", kDigest)), "sha256");
  EXPECT_EQ(place_of(ProtocolJson(kBody, std::string(64, '0'))), "sha256");
  EXPECT_EQ(place_of(ProtocolJson("[]", kDigest)), "protocol");
  EXPECT_EQ(place_of(R"({"schema": "mvstudio.avatar-protocol/2"})"), "schema");
}

TEST(AvatarScores, TheFirstDifferenceIsThatOfTheFirstFilesOrder) {
  const ScoreProtocol first = Protocol("A/protocol.json", R"({"crop": {"size_px": 128, "fill": 1}, "net": "posenet"})");
  EXPECT_EQ(FirstDifference(Protocol("B", R"({"net": "posenet", "crop": {"fill": 1, "size_px": 128}})"), first), "");
  const ScoreProtocol own = Protocol("B", R"({"net": "gabor", "crop": {"fill": 1, "size_px": 96}})");
  EXPECT_EQ(FirstDifference(own, first), "crop.size_px is 96, in A/protocol.json it is 128");
  EXPECT_EQ(FirstDifference(Protocol("B", R"({"crop": {"size_px": 128, "fill": 1}})"), first),
            "net is not there, in A/protocol.json it is posenet");
  EXPECT_EQ(FirstDifference(first, Protocol("B", R"({"crop": {"size_px": 128, "fill": 1}})")),
            "net is posenet, in B it is not there");
  EXPECT_EQ(PlaceInError([&] { RequireSameProtocol(own, first); }), "crop.size_px");
  EXPECT_NO_THROW(RequireSameProtocol(first, first));
}

TEST(AvatarScores, ADifferenceOfCamerasBearsTheStudiosNames) {
  const TempDir folder;
  Put(folder / "data/dataset.json",
      R"({"schema": "mvstudio.dataset/1", "cameras": [{"name": "00_01", "alias": "left"}, {"name": "00_03", "alias": "gopro2"}]})");
  Put(folder / "run/protocol.json", ProtocolJson(kBody, kDigest));
  Put(folder / "run/config.json", R"({"dataset": ")" + (folder / "data") + "\"}");
  ScoreProtocol own = ReadScoreProtocol(folder / "run"), first = Protocol("A", R"({"holdout": {"cameras": ["00_03"]}})");
  own.body = Protocol("B", R"({"holdout": {"cameras": ["00_01", "00_03"]}})").body;
  EXPECT_EQ(FirstDifference(own, first), R"(holdout.cameras is ["left","gopro2"], in A it is ["00_03"])");
  Put(folder / "run/config.json", R"({"dataset": "moved"})");
  EXPECT_TRUE(ReadScoreProtocol(folder / "run").studio_names.empty());
}

TEST(AvatarScores, ARunIsReadWithItsProtocolAndRefusedWithThePlace) {
  const TempDir folder;
  const std::string run = folder / "run";
  EXPECT_THAT(MessageOf<IoError>([&] { ReadScoredRun(run); }), HasSubstr("no such folder"));
  Put(folder / "run/protocol.json", ProtocolJson(kBody, kDigest));
  EXPECT_THAT(MessageOf<IoError>([&] { ReadScoredRun(run); }), HasSubstr("mvstudio avatar eval"));
  const auto place_of = [&](const std::string& metrics) {
    Put(folder / "run/avatar_eval.result.json", R"({"metrics": )" + metrics + "}");
    return PlaceInError([&] { ReadScoredRun(run); });
  };
  EXPECT_EQ(place_of(R"({"holdout": {"psnr_db": 20}})"), "metrics.holdout.ssim");
  EXPECT_EQ(place_of(R"({"holdout": {"ssim": null}})"), "metrics.holdout.ssim");
  const std::string scored = R"({"holdout": {"ssim": 0.75}, "protocol_sha256": ")";
  EXPECT_EQ(place_of(scored + std::string(64, '0') + "\"}"), "metrics.protocol_sha256") << "scored by another protocol";
  EXPECT_EQ(place_of(scored + kDigest + "\"}"), "no FormatError");
  const ScoredRun read = ReadScoredRun("ours=" + run + "//");
  EXPECT_EQ(read.label, "ours");
  EXPECT_EQ(read.folder, run);
  EXPECT_EQ(read.metrics["holdout"]["ssim"].Number(), 0.75);
  EXPECT_EQ(read.protocol.sha256, kDigest);
}

}  // namespace
}  // namespace mvstudio::stages
