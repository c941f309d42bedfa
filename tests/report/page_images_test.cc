#include "core/error.h"
#include "tests/report/run_fixture.h"

namespace mvstudio::report {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(ReportTest, KeyPointsAndMasksShowTheirImages) {
  for (const char* command : {"pose2d", "mask"}) {
    SavePng(std::string(command) + "/left.png");
    Json result = Result(command, {{"backend", "background"}, {"per_camera", {{{"name", "left"}, {"flicker", 0.0125}}}}});
    result["outputs"] = {{{"path", std::string("/moved/") + command + "/left.png"}, {"role", "overlay"}}};
    Save(std::string(command) + "/" + command + ".result.json", result);
  }
  const Report report = Build();
  EXPECT_THAT(report.html, AllOf(HasSubstr("Footage, keypoints and masks"), HasSubstr("0.0125"), HasSubstr("background")));
  size_t images = 0;
  for (size_t at = report.html.find("data:image/png"); at != std::string::npos; at = report.html.find("data:image/png", at + 1))
    ++images;
  EXPECT_EQ(images, 2u);
  EXPECT_THAT(report.warnings, IsEmpty());
}

TEST_F(ReportTest, AClientSeesThePreviewFirstAndNeitherPathsNorAdvice) {
  SaveWholeRun();
  SaveText("avatar/turn_cam.mp4", std::string("\0\0\0\x18"
                                              "ftypmp42-the-video",
                                              22));
  Json render = Result("avatar render", {{"images", 48}, {"masks_from", "/home/me/masks"}});
  render["outputs"] = {{{"path", "/home/me/run/avatar/turn_cam.mp4"}, {"role", "video"}}};
  render["argv"] = {"mvstudio", "avatar", "render", "/home/me/run"};
  render["errors"] = {{{"code", "X"}, {"text", "/home/me is full"}}};
  Save("avatar/render.result.json", render);
  ReportOptions options;
  options.audience = "client";
  const Report report = Build(options);
  const size_t video = report.html.find("<video controls loop muted src=\"data:video/mp4;base64,AAAAGGZ0eXB");
  ASSERT_NE(video, std::string::npos);
  EXPECT_LT(video, report.html.find("<h2>Verdict"));
  EXPECT_THAT(report.html,
              AllOf(HasSubstr("media-src data:"), HasSubstr("The avatar in motion: turn cam"), HasSubstr("<h2>Rig")));
  for (const std::string& hidden : {run_, std::string("/home/me"), std::string(".json"), std::string("What to fix"),
                                    std::string("Provenance"), std::string("saw the board in few places")}) {
    EXPECT_THAT(report.html.substr(0, report.html.find("<footer>")), Not(HasSubstr(hidden)));
  }
  for (const std::string& hidden : {run_, std::string("/home/me"), std::string("argv"), std::string("outputs")})
    EXPECT_THAT(report.json, Not(HasSubstr(hidden)));
  EXPECT_THAT(Build().html, HasSubstr("<video")) << "the studio's page has it, too";
  options.audience = "friend";
  EXPECT_THROW(BuildReport(run_, options), UsageError);
}

TEST_F(ReportTest, ATurnWithoutAVideoIsShownByEightOfItsImages) {
  Json render = Result("avatar render", {{"images", 20}});
  for (int i = 0; i < 20; ++i) {
    const std::string name = "turn/turn_000000" + std::to_string(10 + i) + ".png";
    SavePng("render/" + name);
    render["outputs"].push_back({{"path", "/gone/render/" + name}, {"role", "rendered-picture"}});
  }
  Save("render/avatar_render.result.json", render);
  const std::string html = Build().html;
  size_t images = 0;
  for (size_t at = html.find("<img "); at != std::string::npos; at = html.find("<img ", at + 1)) ++images;
  EXPECT_EQ(images, 8u);
  EXPECT_THAT(html, AllOf(HasSubstr(">turn 00000010<"), HasSubstr(">turn 00000027<"), Not(HasSubstr("turn 00000011"))));
}

TEST_F(ReportTest, CaptionsAreWordsAndNotPaths) {
  SavePng("masks/cam_01.sheet.png");
  SavePng("masks/other_view.png");
  Json result = Result("mask", {{"per_camera", {{{"name", "cam_01"}, {"flicker", 0.0125}}}}});
  result["outputs"] = {{{"path", "S3/masks/cam_01.sheet.png"}, {"role", "overlay"}},
                       {{"path", "S3/masks/other_view.png"}, {"role", "overlay"}}};
  Save("masks/mask.result.json", result);
  const std::string html = Build().html;
  EXPECT_THAT(html, AllOf(HasSubstr("<figcaption>Outlines of the masks, camera cam_01</figcaption>"),
                          HasSubstr("<figcaption>Outlines of the masks: other view</figcaption>")));
  EXPECT_THAT(html.substr(0, html.find("<section id=\"provenance\"")), Not(HasSubstr("S3/masks"))) << "nor to screen readers";
}

/// Three strips, named so that the worst is neither first nor last, of 4 x 1 and one of 1 x 1 px.
TEST_F(ReportTest, HeldOutImagesComeFirstTheWorstBeforeOthersWithASlider) {
  const double ssim[] = {0.9, 0.7, 0.8};
  Json images = Json::array(), outputs = Json::array();
  for (int i = 0; i < 3; ++i) {
    const std::string file = "left_0000000" + std::to_string(i) + ".png";
    SavePng(file);
    if (i > 0) {
      std::string png = ReadFile(run_ + "/" + file);
      png[19] = 4;  // the width that its header states
      SaveText(file, png);
    }
    images.push_back({{"path", file}, {"camera", "left"}, {"frame", i}, {"ssim", ssim[i]}});
    outputs.push_back({{"path", file}, {"role", "heldout-picture"}});
  }
  Json result = Result("avatar eval", {{"holdout", {{"n", 3}, {"ssim", 0.8}}}, {"pictures", images}});
  result["outputs"] = outputs;
  Save("avatar_eval.result.json", result);
  const std::string html = Build().html;
  const size_t worst = html.find("camera left, frame 1, SSIM 0.700"), next = html.find("camera left, frame 2, SSIM 0.800"),
               best = html.find("camera left, frame 0, SSIM 0.900");
  ASSERT_NE(best, std::string::npos);
  EXPECT_LT(worst, next);
  EXPECT_LT(next, best);
  EXPECT_LT(best, html.find("What to fix first"));
  size_t sliders = 0;
  for (size_t at = html.find(" data-compared>"); at < html.find("<script>"); at = html.find(" data-compared>", at + 1))
    ++sliders;
  EXPECT_EQ(sliders, 2u) << "a square is no strip";
  EXPECT_THAT(html, HasSubstr("script-src 'sha256-"));
  EXPECT_THAT(html, HasSubstr("worst frame 1 of left, SSIM 0.7"));
}

TEST_F(ReportTest, AFittedBodyShowsItsStepsCamerasAndSurface) {
  SavePng("body/surface.png");
  const Json stages = {{{"name", "offsets, smooth to 1.0 mm"}, {"held_out_iou", 0.9375}, {"seconds", 4.5}, {"kept", true}}};
  Json result = Result("avatar fit", {{"stages", stages},
                                      {"cameras", {{"00_07", {{"silhouettes", 12}, {"rejected", 3}, {"iou", 0.9125}}}}},
                                      {"surface_sigma_mm", {{"median", 2.25}, {"quantile_95", 9.5}, {"share_below_10", 0.96}}},
                                      {"surface_maps", {{"offset_limit_mm", 25}, {"sigma_limit_mm", 10}}}});
  result["outputs"] = {{{"path", "surface.png"}, {"role", "surface-maps"}}};
  Save("body/avatar_fit.result.json", result);
  const Report report = Build();
  EXPECT_THAT(report.html, AllOf(HasSubstr("offsets, smooth to 1.0 mm"), HasSubstr("0.9375"), HasSubstr("00_07"),
                                 HasSubstr("0.9125"), HasSubstr("96\u00a0% of the vertices"), HasSubstr("front, deviation")));
  EXPECT_THAT(report.html, HasSubstr("data:image/png"));
  EXPECT_THAT(report.warnings, IsEmpty());
}

}  // namespace
}  // namespace mvstudio::report
