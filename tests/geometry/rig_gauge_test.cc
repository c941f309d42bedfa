#include "geometry/rig/rig_gauge.h"

#include <vector>

#include "geometry/rig/rig_io.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

using Kind = RigGauge::Kind;

struct Case {
  RigGauge gauge;
  std::string text;  // as in files that are already there
};

RigGauge With(RigGauge gauge, bool stated_lengths, const std::string& relative_to) {
  gauge.stated_lengths = stated_lengths, gauge.relative_to = relative_to;
  return gauge;
}

RigGauge ByDistance() {
  RigGauge gauge = RigGauge::OfCamera("left");
  gauge.distance_to = "right";
  return gauge;
}

std::vector<Case> Cases() {
  return {{{}, ""},
          {{Kind::kImported}, "as imported"},
          {kLensesOnly, "none: lenses only, every camera in a frame of its own"},
          {RigGauge::OfCamera("00_00"), "camera 00_00"},
          {RigGauge::OfCamera("a \"b\", c"), "camera a \"b\", c"},
          {ByDistance(), "camera left, its distance to right"},
          {RigGauge::OfBoard(0), "board in frame 0"},
          {RigGauge::OfBoard(-12), "board in frame -12"},
          {{Kind::kSceneBoard, "", 3}, "the board in frame 3"},
          {{Kind::kSceneBoard}, "the board in the scene"},
          {{Kind::kPoints}, "the marked points"},
          {{Kind::kFloor}, "floor under people's feet"},
          {{Kind::kPanoptic, "", std::nullopt, "file a.json"}, "Panoptic file a.json"},
          {RigGauge::Other("COLMAP's world"), "COLMAP's world"},
          {RigGauge::Other("camera"), "camera"},
          {RigGauge::Other("camera "), "camera "},
          {RigGauge::Other("board in frame 07"), "board in frame 07"},
          {RigGauge::Other("board in frame 1 of 3"), "board in frame 1 of 3"}};
}

TEST(RigGauge, EveryKindHasTheTextOfEarlierFilesAndIsReadBack) {
  for (const Case& c : Cases()) {
    for (const bool lengths : {false, true}) {
      for (const std::string relative_to : {"", "camera cam0, size by stated lengths"}) {
        const RigGauge gauge = With(c.gauge, lengths, relative_to);
        std::string text = c.text;
        if (lengths) text += text.empty() ? "size by stated lengths" : ", size by stated lengths";
        if (!relative_to.empty()) text += "; uncertainty relative to " + relative_to;
        EXPECT_EQ(GaugeText(gauge), text);
        EXPECT_TRUE(GaugeFromText(text) == gauge) << text;
      }
    }
  }
}

TEST(RigGauge, FilesKeepTheirTextWhateverItSays) {
  for (const std::string text :
       {"board in frame 99999999999999999999", "; uncertainty relative to ", ", size by stated lengths",
        "camera a, size by stated lengths, size by stated lengths", "as imported ", "Panoptic "}) {
    EXPECT_EQ(GaugeText(GaugeFromText(text)), text);
    Rig rig;
    rig.gauge = GaugeFromText(text);
    rig.cameras.emplace_back();
    rig.cameras[0].camera.name = "cam0", rig.cameras[0].camera.width_px = rig.cameras[0].camera.height_px = 100;
    rig.cameras[0].camera.params = Eigen::Vector4d(100, 100, 50, 50);
    const std::string file = RigToJsonText(rig);
    EXPECT_THAT(file, HasSubstr("\"gauge\": \"" + text + "\""));
    EXPECT_EQ(RigToJsonText(RigFromJsonText(file, "file")), file);
  }
}

TEST(RigGauge, AMoveKeepsWhatCovariancesAreRelativeTo) {
  const RigGauge once = GaugeAfterMove({Kind::kPoints}, With(RigGauge::OfCamera("cam0"), true, ""));
  EXPECT_EQ(GaugeText(once), "the marked points; uncertainty relative to camera cam0, size by stated lengths");
  EXPECT_EQ(GaugeText(GaugeAfterMove({Kind::kFloor}, once)),
            "floor under people's feet; uncertainty relative to camera cam0, size by stated lengths");
  EXPECT_EQ(GaugeText(GaugeAfterMove({Kind::kPoints}, {})), "the marked points");
}

TEST(RigGauge, OnlyWorldsThatSomebodySetAreUpright) {
  for (const Case& c : Cases()) {
    const bool upright = c.text.rfind("board in frame -", 0) == 0 || c.text == "board in frame 0" ||
                         c.text == "the board in frame 3" || c.gauge.kind == Kind::kFloor || c.gauge.kind == Kind::kPanoptic;
    EXPECT_EQ(c.gauge.IsUpright(), upright) << c.text;
  }
}

}  // namespace
}  // namespace mvstudio::geometry
