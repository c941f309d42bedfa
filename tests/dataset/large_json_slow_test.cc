#include <fstream>
#include <functional>

#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/panoptic_files.h"
#include "dataset/panoptic/sequence.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/time/sync_file.h"
#include "dataset/time/timeline.h"
#include "dataset/verify/verify.h"
#include "dataset/views/split.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/support/cpu_time.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Files of 10 MB that a reader of quadratic time chews on for minutes to days.
namespace mvstudio::dataset {
namespace {

using Item = std::function<std::string(int)>;

constexpr size_t kBytes = 10u << 20;

std::string Many(const std::string& head, const Item& item, const std::string& tail, size_t bytes = kBytes) {
  std::string text = head;
  for (int i = 0; text.size() + tail.size() < bytes; ++i) text += (i ? "," : "") + item(i);
  return text + tail;
}

std::string Key(int i) { return "\"k" + std::to_string(i) + "\":"; }

struct JsonReader {
  std::string name, file;
  std::function<void(const std::string& path)> read;
  std::vector<std::pair<std::string, std::string>> lists;  ///< text before a list, text after it
  size_t bytes = kBytes;
};

std::vector<JsonReader> Readers() {
  const auto folder_of = [](const std::string& path) { return path.substr(0, path.rfind('/')); };
  const auto openpose = [=](const std::string& path) {
    ReadOpenPoseFolder(folder_of(path), "cam", geometry::SkeletonByName("body25"));
  };
  const auto results = [](const std::string& path) { ReadPoseResults(path, "cam", geometry::SkeletonByName("coco17")); };
  return {
      {"calibration",
       "calibration_a.json",
       [](const std::string& p) { ReadPanopticCalibration(p); },
       {{"{\"cameras\":[", "]}"}}},
      {"any", "calibration_a.json", [](const std::string& p) { ReadAnyCalibration(p); }, {{"{\"cameras\":[", "]}"}}},
      {"scene",
       "body3DScene_00000001.json",
       [](const std::string& p) { ReadBody3dSceneFile(p); },
       {{"{\"bodies\":[", "]}"}},
       4u << 20},
      {"landmarks",
       "faceRecon3D_hd00000001.json",
       [](const std::string& p) { ReadPanopticLandmarks(p); },
       {{"{\"people\":[", "]}"}}},
      {"synctables",
       "synctables_a.json",
       [](const std::string& p) {
         const PanopticSyncTables tables = ReadPanopticSyncTables(p);
         tables.Find("hd");
       },
       {{"{\"hd\":{\"univ_time\":[", "]}}"}}},
      {"split",
       "split.json",
       [](const std::string& p) { ReadSplit(p); },
       {{R"({"schema":"mvstudio.split/1","dataset":"d","train":{"cameras":[],"frames":[]},"test":{"cameras":[],"frames":[]},"unused_frames":[)",
         "]}"},
        {R"({"schema":"mvstudio.split/1","dataset":"d","train":{"cameras":[],"frames":[]},"test":{"cameras":[],"frames":[]},"motion_blocks":[)",
         "]}"}}},
      {"timeline",
       "t.timeline.json",
       [](const std::string& p) { ReadTimeline(p); },
       {{R"({"schema":"mvstudio.timeline/1","take":"t","reference":"a","clock":"start","fps_hz":30,"start_s":0,"num_instants":1,"cameras":[)",
         "]}"}}},
      {"sync",
       "sync.json",
       [](const std::string& p) { ReadSync(p); },
       {{R"({"schema":"mvstudio.sync/1","reference":"a","fps":30,"cameras":[)", "]}"}}},
      {"pose3d", "pose3d.json", [=](const std::string& p) { ReadPose3d(folder_of(p)); }, {}},
      {"aliases", "dataset.json", [=](const std::string& p) { ReadPanopticAliases(folder_of(p)); }, {{"{\"cameras\":[", "]}"}}},
      {"openpose", "cam_0_keypoints.json", openpose, {{"{\"people\":[", "]}"}}},
      {"coco", "coco.json", results, {{"[", "]"}}},
      {"mmpose", "mmpose.json", results, {{"{\"instance_info\":[", "]}"}}},
  };
}

class LargeJson : public ::testing::TestWithParam<JsonReader> {
 protected:
  void Read(const std::string& text, const std::string& what) {
    std::ofstream(folder_ / GetParam().file) << text;
    const double start = mvstudio::testing::CpuSeconds();
    try {
      GetParam().read(folder_ / GetParam().file);
    } catch (const FormatError&) {
    } catch (const IoError&) {
    }
    EXPECT_LT(mvstudio::testing::CpuSeconds() - start, 20) << what;
  }

  TempDir folder_;
};

TEST_P(LargeJson, IsAnsweredAtOnce) {
  const size_t bytes = GetParam().bytes;
  const Item key = [](int i) { return Key(i) + "0"; }, empty = [](int) { return std::string("{}"); };
  const Item number = [](int i) { return std::to_string(i % 10); };
  const Item table = [](int i) { return Key(i) + "{\"univ_time\":[]}"; };
  Read(Many("{", table, "}", bytes), "objects under keys");
  Read(Many("[", empty, "]", bytes), "objects");
  Read(Many("{\"a\":{\"" + std::string(bytes / 2, 'x') + "\":{", table, "}}}", bytes), "below a long key");
  for (const auto& [head, tail] : GetParam().lists) {
    for (const Item& item : {empty, number}) {
      const bool in_object = tail.back() == '}';
      const std::string list = Many(head, item, tail, in_object ? bytes / 2 : bytes);
      const std::string keys = in_object ? Many(",", key, "}", bytes / 2) : "]";
      Read(list.substr(0, list.size() - 1) + keys, "a long list, beside many keys");
    }
  }
}

std::string NameOf(const ::testing::TestParamInfo<JsonReader>& reader) { return reader.param.name; }

INSTANTIATE_TEST_SUITE_P(Readers, LargeJson, ::testing::ValuesIn(Readers()), NameOf);

TEST(VerifyLargeJson, CountsWhatItDoesNotList) {
  const TempDir folder;
  std::ofstream(folder / "calibration_a.json") << Many(
      "{\"cameras\":[", [](int) { return std::string("{}"); }, "]}");
  const double start = mvstudio::testing::CpuSeconds();
  const VerifyReport report = VerifyDataset(folder.path());
  EXPECT_LT(report.findings.size(), 200u);
  EXPECT_LT(mvstudio::testing::CpuSeconds() - start, 20);
}

}  // namespace
}  // namespace mvstudio::dataset
