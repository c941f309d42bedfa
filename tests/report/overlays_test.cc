#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "report/page/image.h"
#include "report/report.h"
#include "report/svg/svg.h"
#include "tests/report/markup.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kJpeg = std::string("\xff\xd8\xff", 3) + "data";

ImageOverlaySpec HundredPixels() {
  ImageOverlaySpec spec;
  spec.title = "left <0>";
  spec.width_px = 100, spec.height_px = 50, spec.width = 400;
  return spec;
}

TEST(ImageOverlay, RingsAndEnlargedArrowsInPixelsOfTheFrame) {
  ImageOverlaySpec spec = HundredPixels();
  spec.points = {{9.5, 19.5, 0.25, 0}};  // 10, 20 px from the edges of the image
  spec.enlarge = true;
  spec.image = kJpeg;
  const std::string svg = ImageOverlay(spec);
  EXPECT_EQ(MarkupChecker(svg).Run(), "");
  EXPECT_THAT(svg, HasSubstr("M35 102a5 5")) << "a ring about 4 * 10, 22 + 4 * 20";
  EXPECT_THAT(svg, HasSubstr("M40 102L60 102")) << "5 px of 100 at most: the factor is 20, the arrow 0.25 * 20 * 4 long";
  EXPECT_THAT(svg, HasSubstr("arrows enlarged \u00d720<"));
  EXPECT_THAT(svg, HasSubstr("href=\"data:image/jpeg;base64," + Base64(kJpeg) + "\""));
  EXPECT_THAT(svg, HasSubstr("left &lt;0&gt;"));
}

TEST(ImageOverlay, APartOfTheFrameAndLinesFromProjectionToKeypoint) {
  ImageOverlaySpec spec = HundredPixels();
  spec.left_px = 49.5, spec.top_px = 9.5, spec.width_px = 40, spec.height_px = 20;
  spec.points = {{59.5, 19.5, 1, -2}};
  spec.bones = {{{49.5, 9.5}, {51.5, 10.5}}, {{std::nan(""), 3}, {4, 5}}};
  const std::string svg = ImageOverlay(spec);
  EXPECT_THAT(svg, HasSubstr("M90 142L100 122")) << "ten pixels a pixel, unenlarged, ending at the keypoint";
  EXPECT_THAT(svg, HasSubstr("\"M0 22L20 32\"")) << "one bone; the other has no end";
  EXPECT_THAT(svg, Not(HasSubstr("enlarged")));
  EXPECT_THAT(svg, Not(HasSubstr("<image")));
}

TEST(ImageOverlay, ExtremesAreLeftOut) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double size : {0.0, -1.0, std::nan(""), infinity}) {
    ImageOverlaySpec spec = HundredPixels();
    spec.width_px = size;
    const std::string svg = ImageOverlay(spec);
    EXPECT_TRUE(svg.empty() || MarkupChecker(svg).Run().empty()) << size;
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
  }
  ImageOverlaySpec spec = HundredPixels();
  spec.points = {{std::nan(""), 2, 0, 0}, {1e300, -1e300, infinity, 0}};
  spec.rejected = {{infinity, 0, 0, 0}};
  spec.image = "no image";
  spec.enlarge = true;
  const std::string svg = ImageOverlay(spec);
  EXPECT_EQ(MarkupChecker(svg).Run(), "");
  for (const char* wrong : {"nan", "inf", "<image"}) EXPECT_THAT(svg, Not(HasSubstr(wrong)));
}

class OverlaySectionTest : public ::testing::Test {
 protected:
  void Save(const std::string& file, const std::string& command, const Json& metrics) {
    const Json result = {{"schema", "mvstudio.result/1"},
                         {"command", command},
                         {"status", "ok"},
                         {"exit", 0},
                         {"metrics", metrics},
                         {"outputs", Json::array()},
                         {"warnings", Json::array()},
                         {"errors", Json::array()}};
    WriteFileAtomic(run_ / file, result.dump());
  }
  static Json BoardView(const Json& image) {
    return {{"camera", "left"},
            {"frame", 12},
            {"kind", "worst"},
            {"rms_px", 0.25},
            {"box_px", {90, 40, 320, 240}},
            {"picture", image},
            {"corners", {{100, 50, 0.1, 0, 0}, {200, 60, 0, 0.2, 0}, {300, 60, 9, 9, 1}}}};
  }
  static Json JointView(const Json& frame, const Json& image) {
    return {{"camera", "left"},
            {"instant", 3},
            {"frame", frame},
            {"median_px", 1.5},
            {"max_px", 2},
            {"num_points", 2},
            {"box_px", {10, 20, 100, 200}},
            {"picture", image},
            {"joints", {{30, 40, 31, 40}, {50, 60, 50, 62}, {70, 80, nullptr, nullptr}}}};
  }

  testing::TempDir run_;
};

TEST_F(OverlaySectionTest, BoardsWithTheirImagesAndWithout) {
  WriteFileAtomic(run_ / "board-views/00.jpg", kJpeg);
  Save("calibrate.result.json", "calibrate",
       {{"board_views", {BoardView("/once/here/board-views/00.jpg"), BoardView("gone.jpg"), BoardView(nullptr)}}});
  const Report report = BuildReport(run_.path());
  EXPECT_THAT(report.html, HasSubstr("left, frame 12: largest residuals"));
  EXPECT_THAT(report.html, HasSubstr("2 corners, rms 0.25\u00a0px; 1 rejected (crosses)."));
  EXPECT_THAT(report.html, HasSubstr("1 rejected (crosses); the image itself is not at hand."));
  EXPECT_EQ(report.warnings.size(), 1u) << "the image that was named and is gone";
  const size_t first = report.html.find("<image");
  ASSERT_NE(first, std::string::npos);
  EXPECT_EQ(report.html.find("<image", first + 1), std::string::npos);
}

TEST_F(OverlaySectionTest, JointsOverTheImages) {
  Save("triangulate.result.json", "triangulate",
       {{"overlays",
         {{"bones", {{0, 1}, {1, 2}, {0, 7}, {-1, 0}}},
          {"num_joints", 3},
          {"views", {JointView(5, nullptr), JointView(nullptr, nullptr)}}}}});
  const Report report = BuildReport(run_.path());
  EXPECT_THAT(report.html, HasSubstr("left, frame 5"));
  EXPECT_THAT(report.html, HasSubstr("left, time step 3"));
  EXPECT_THAT(report.html, HasSubstr("median distance 1.5\u00a0px, largest 2\u00a0px, 2 keypoints; the image"));
  EXPECT_THAT(report.html, HasSubstr("class=\"over-bone\""));
}

TEST_F(OverlaySectionTest, OtherTypesThanExpectedDoNoHarm) {
  for (const Json& odd : {Json(7), Json("text"), Json({1, nullptr, "x"}), Json({{"views", {1, {{"joints", 3}}}}}),
                          Json({{{"box_px", {0, 0, 1e300, 1}}, {"corners", {1, {2}}}}})}) {
    Save("calibrate.result.json", "calibrate", {{"board_views", odd}});
    Save("triangulate.result.json", "triangulate", {{"overlays", odd}});
    const Report report = BuildReport(run_.path());
    for (const char* number : {"\"nan", " nan", ">nan", "\"inf", " inf"})
      EXPECT_EQ(report.html.find(number), std::string::npos) << number << " of " << odd;
  }
}

}  // namespace
}  // namespace mvstudio::report
