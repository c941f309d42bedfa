#include "stages/click/click_scene.h"

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/random.h"
#include "tests/stages/click_setup.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

std::string ClickJson(int camera, int point, double x, double y) {
  return nlohmann::json{{"camera", camera}, {"point", point}, {"x", x}, {"y", y}}.dump();
}
std::string Clicks(const std::string& items) { return "{\"clicks\": [" + items + "]}"; }

TEST(ClickScene, ExactClicksHaveNoResidualAndShowWhereTheOthersAre) {
  ClickScene scene = WallScene();
  for (int p = 0; p < 7; ++p) scene.clicks[{0, p}] = TruePx(p);
  const ClickFit fit = FitClicks(scene, 0, {});
  ASSERT_EQ(fit.status, Status::kOk) << fit.message;
  EXPECT_LT(fit.rms_px, 1e-6);
  EXPECT_THAT(fit.rejected, IsEmpty());
  ASSERT_EQ(fit.predicted_px.size(), 12u);
  for (int p = 0; p < 12; ++p) EXPECT_LT((fit.predicted_px.at(p) - TruePx(p)).norm(), 1e-5) << p;
}

TEST(ClickScene, AWrongClickIsNamedAndItsResidualPointsToTheClick) {
  ClickScene scene = WallScene();
  Rng rng(3);
  for (int p = 0; p < 12; ++p) scene.clicks[{0, p}] = TruePx(p) + 0.3 * Eigen::Vector2d(rng.Normal(), rng.Normal());
  scene.clicks[{0, 5}] += Eigen::Vector2d(40, 0);
  const ClickFit fit = FitClicks(scene, 0, {});
  ASSERT_EQ(fit.status, Status::kOk);
  EXPECT_THAT(fit.rejected, ElementsAre(5));
  EXPECT_NEAR(fit.residual_px.at(5).x(), 40, 2) << "observed minus projected";
  EXPECT_LT(fit.rms_px, 1);
}

TEST(ClickScene, SaysWhatIsMissing) {
  ClickScene scene = WallScene();
  EXPECT_THAT(FitClicks(scene, 0, {}).message, HasSubstr("0 of the 4 clicks"));
  EXPECT_THAT(FitClicks(scene, 1, {}).message, HasSubstr("lens is not known"));
  for (int p = 0; p < 4; ++p) scene.clicks[{0, p}] = {100.0 + 50 * p, 200};
  scene.x_in_world.row(1).setZero(), scene.x_in_world.row(2).setZero();
  const ClickFit line = FitClicks(scene, 0, {});
  EXPECT_NE(line.status, Status::kOk) << "all on one line";
  EXPECT_FALSE(line.message.empty());
  EXPECT_TRUE(std::isnan(line.rms_px));
  EXPECT_TRUE(nlohmann::json::parse(ClicksJsonText(scene, {}))["fits"][0]["rms_px"].is_null());
}

TEST(ClickScene, OnlyWhatThePageMaySendIsTaken) {
  const ClickScene scene = WallScene();
  const std::string two = ClickJson(0, 3, 10.25, 20.5) + "," + ClickJson(1, 3, 319.5, -0.5);
  const SentClicks sent = ReadSentClicks("{\"revision\": 7, \"clicks\": [" + two + "]}", scene);
  ASSERT_EQ(sent.clicks.size(), 2u);
  EXPECT_EQ(sent.clicks.at({0, 3}), Eigen::Vector2d(10.25, 20.5));
  EXPECT_EQ(sent.revision, 7);
  EXPECT_EQ(ReadSentClicks(Clicks(two), scene).revision, -1) << "not that of any scene";
  const std::string ok = ClickJson(0, 3, 1, 1);
  for (const std::string& bad :
       {std::string(""), std::string("[]"), std::string("{\"clicks\": {}}"), std::string("{\"clicks\": [1]}"),
        Clicks(ok + "," + ok), Clicks(ClickJson(2, 0, 1, 1)), Clicks(ClickJson(-1, 0, 1, 1)), Clicks(ClickJson(0, 12, 1, 1)),
        Clicks(ClickJson(0, 0, 640, 1)), Clicks(ClickJson(0, 0, 1, -0.6)),
        Clicks("{\"camera\": 0, \"point\": 1.5, \"x\": 1, \"y\": 1}"),
        Clicks("{\"camera\": 0, \"point\": 1, \"x\": null, \"y\": 1}"),
        Clicks("{\"camera\": 0, \"point\": 1, \"x\": 1e999, \"y\": 1}")}) {
    EXPECT_THROW(ReadSentClicks(bad, scene), FormatError) << bad;
  }
}

TEST(ClickScene, TheTableIsReadBackAndGoneOnWith) {
  const TempDir folder;
  ClickScene scene = WallScene();
  scene.clicks[{0, 0}] = {1.25, 2.5};
  scene.clicks[{1, 11}] = {300.125, 7};
  Put(folder / "clicks.csv", ClicksCsv(scene));
  std::string places = "name,x,y,z\n";
  for (size_t p = 0; p < scene.names.size(); ++p) {
    const Eigen::Vector3d x = scene.x_in_world.col(static_cast<Eigen::Index>(p));
    places += scene.names[p] + "," + std::to_string(x.x()) + "," + std::to_string(x.y()) + "," + std::to_string(x.z()) + "\n";
  }
  Put(folder / "places.csv", places);
  const calib::ScenePoints read = calib::ReadScenePoints({folder / "clicks.csv", folder / "places.csv"});
  EXPECT_THAT(read.cameras, ElementsAre("a", "b \"2\""));
  ClickScene again = WallScene();
  again.clicks.clear();
  EXPECT_THAT(AddPoints(calib::ReadScenePlaces({folder / "places.csv", folder / "clicks.csv"}), &again), IsEmpty());
  EXPECT_EQ(again.names, scene.names);
  EXPECT_EQ(again.clicks, scene.clicks);
  again.cameras.pop_back();
  EXPECT_THAT(AddPoints(read, &again), ElementsAre("b \"2\""));
  EXPECT_TRUE(calib::ReadScenePlaces({folder / "places.csv"}).clicks.empty());
  EXPECT_THROW(calib::ReadScenePoints({folder / "places.csv"}), FormatError);
}

TEST(ClickScene, CamerasOfTwoSizesOrNamesAreRefused) {
  ClickScene scene = WallScene();
  EXPECT_THAT(MessageOf<UsageError>([&] { AddCamera("a", Image(640, 480, 3), std::nullopt, &scene); }),
              HasSubstr("given twice"));
  EXPECT_THAT(MessageOf<UsageError>([&] { AddCamera("c", Image(10, 10, 3), testing::ClickLens(), &scene); }),
              HasSubstr("its image is 10x10, the calibration says 640x480"));
}

TEST(ClickScene, PointsMayHaveNoPlaces) {
  const TempDir folder;
  Put(folder / "names.csv", "name\ndoor\nlamp\n");
  ClickScene scene = WallScene();
  EXPECT_THAT(AddPoints(calib::ReadScenePlaces({folder / "names.csv"}), &scene), IsEmpty());
  EXPECT_THAT(scene.names, ElementsAre("door", "lamp"));
  scene.clicks[{0, 1}] = {3, 4};
  const ClickFit fit = FitClicks(scene, 0, {});
  EXPECT_NE(fit.status, Status::kOk);
  EXPECT_THAT(fit.message, HasSubstr("no places"));
  EXPECT_TRUE(nlohmann::json::parse(SceneJsonText(scene, {}))["points"][0]["x"].is_null());

  Put(folder / "some.csv", "name,x,y,z\ndoor,1,2,3\n");
  Put(folder / "clicks.csv", "camera,point,x_px,y_px\na,lamp,3,4\n");
  EXPECT_THAT(MessageOf<FormatError>([&] {
                calib::ReadScenePlaces({folder / "some.csv", folder / "clicks.csv"});
              }),
              HasSubstr("'lamp' is clicked but has no place"));
}

}  // namespace
}  // namespace mvstudio::stages
