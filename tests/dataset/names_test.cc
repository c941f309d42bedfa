#include <fstream>
#include <functional>

#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/pose/pose2d.h"
#include "dataset/time/sync_file.h"
#include "dataset/time/timeline.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

struct File {
  const char* place;  ///< as the message says it
  std::string before, after;
  std::function<void(const std::string& path)> read;
};

// Every file that names cameras refuses what no table and no terminal can hold, and says where.
TEST(CameraNames, AreOneLineInEveryFile) {
  const TempDir folder;
  const File files[] = {
      {"cameras[0].name", R"({"schema":"mvstudio.sync/1","reference":"a","cameras":[{"name":")", R"("}]})",
       [](const std::string& path) { ReadSync(path); }},
      {"cameras[0].name",
       R"({"schema":"mvstudio.timeline/1","take":"t","reference":"a","clock":"start","fps_hz":30,"start_s":0,"num_instants":1,)"
       R"("cameras":[{"name":")",
       R"("}]})", [](const std::string& path) { ReadTimeline(path); }},
      {"cameras[0].name", R"({"cameras":[{"name":")", R"("}]})",
       [](const std::string& path) { ReadPanopticCalibration(path); }}};
  const std::pair<std::string, std::string> names[] = {{"a\\u001b[2J", "control character"},
                                                       {"a\\nb", "control character"},
                                                       {"a\\u009bb", "control character"},
                                                       {std::string(5000, 'x'), "longer than 200 bytes"},
                                                       {"", "is empty"}};
  for (const File& file : files) {
    for (const auto& [name, why] : names) {
      std::ofstream(folder / "file.json") << file.before << name << file.after;
      const std::string said = MessageOf<FormatError>([&, &read = file.read] { read(folder / "file.json"); });
      EXPECT_EQ(said.rfind(folder / "file.json: " + file.place + ": ", 0), 0u) << said;
      EXPECT_NE(said.find(why), std::string::npos) << said;
      EXPECT_LT(said.size(), 300u);
    }
  }
  for (const std::string& name :
       {std::string("a\x1b[2J"), std::string("a\xc2\x9b"), std::string(5000, 'x'), std::string("\xff")}) {
    std::ofstream(folder / "points.csv") << "camera,frame,joint,x_px,y_px\n" << name << ",0,nose,1,2\n";
    EXPECT_THROW(ReadPose2dCsv(folder / "points.csv"), FormatError);
  }
}

}  // namespace
}  // namespace mvstudio::dataset
