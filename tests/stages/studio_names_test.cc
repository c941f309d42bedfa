#include "stages/dataset/studio_names.h"

#include "core/disk/files.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(StudioNames, ReplaceWholeWordsAtOnce) {
  const std::map<std::string, std::string> names = {{"00_01", "gopro2"}, {"00_02", "00_01"}};
  EXPECT_EQ(WithNames("camera 00_01: IoU, 00_02. (00_01)", names), "camera gopro2: IoU, 00_01. (gopro2)");
  for (const char* kept : {"hdImgs/00_01/00_01_00000003.jpg", "00_01.png", "100_01", "00_012", "a-00_01", ""})
    EXPECT_EQ(WithNames(kept, names), kept);
}

TEST(StudioNames, ResultsBearThem) {
  const testing::TempDir folder;
  WriteFileAtomic(folder / "dataset.json",
                  R"({"schema": "mvstudio.dataset/1", "cameras": [{"name": "00_01", "alias": "gopro2"}]})");
  CommandResult result;
  result.metrics = {{"cameras", {{"00_01", {{"iou", 0.5}}}}}, {"views", {"00_01", "00_03"}}, {"n", 3}};
  result.text = "00_01  0.9\n";
  result.errors.push_back({"A", "camera 00_01", "look at 00_01"});
  result = NamedCameras(std::move(result), StudioNames(folder.path()));
  EXPECT_EQ(result.metrics.dump(), R"({"cameras":{"gopro2":{"iou":0.5}},"views":["gopro2","00_03"],"n":3})");
  EXPECT_EQ(result.text, "gopro2  0.9\n");
  EXPECT_EQ(result.errors[0].text + "; " + result.errors[0].hint, "camera gopro2; look at gopro2");
  EXPECT_TRUE(StudioNames(folder / "nowhere").empty());
}

}  // namespace
}  // namespace mvstudio::stages
