#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "stages/pack_speed/measure.h"
#include "tests/support/message_of.h"

namespace mvstudio::stages {
namespace {

using mvstudio::testing::MessageOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

PackSpeedTrial Trial(const std::string& way, const std::string& codec, int crop_px, double crops_per_s, double psnr_db) {
  PackSpeedTrial trial;
  trial.from_folder = way == "folder", trial.codec = codec, trial.crop_px = crop_px, trial.crops_per_s = crops_per_s;
  trial.bytes_per_crop = 2048, trial.psnr_db = psnr_db, trial.rms_levels = std::isinf(psnr_db) ? 0 : 1.5;
  return trial;
}

PackSpeedReport Report() {
  PackSpeedReport report;
  report.images = 24, report.width_px = 640, report.height_px = 480;
  report.trials = {Trial("folder", "jpeg:95", 128, 100, 41.25), Trial("pack", "png", 128, 2500, kInfinity),
                   Trial("folder", "jpeg:95", 0, 50, 41.25), Trial("pack", "png", 0, 75, kInfinity)};
  report.builds = {{"png", 128, 2, 320, 640, 0.5}};
  report.speed_ups = {{128, 1, "jpeg:95", 41.25, "png", kInfinity, 25}};
  return report;
}

const std::vector<bool> kFront = {false, true, false, true};

TEST(PackSpeed, TextNamesEveryWayAndMarksTheFront) {
  const std::string text = PackSpeedText(Report(), kFront);
  EXPECT_THAT(text, HasSubstr("24 images of 640x480\n"));
  EXPECT_THAT(text, HasSubstr("folder  jpeg:95     128        1       100         2048    41.25 \n"));
  EXPECT_THAT(text, HasSubstr("pack    png         128        1      2500         2048    exact *\n"));
  EXPECT_THAT(text, HasSubstr(" full "));
  EXPECT_THAT(
      text, HasSubstr("128 px, 1 thread: pack png     (exact dB) is   25.0 times as fast as folder jpeg:95 + crop (41.25 dB)"));
  EXPECT_THAT(text, HasSubstr("building png at 128 px: 320.0 crops/s; decoding alone would allow 640.0 (50 % of the work)"));
  EXPECT_THAT(text, Not(HasSubstr("inf")));
  EXPECT_THAT(text, Not(HasSubstr("nan")));
}

TEST(PackSpeed, JsonReadsBackWithNullForWhatIsNotFinite) {
  PackSpeedReport report = Report();
  report.builds[0].decode_share = std::nan("");
  const nlohmann::json json = nlohmann::json::parse(PackSpeedJson(report, kFront));
  EXPECT_EQ(json["pictures"], 24);
  ASSERT_EQ(json["trials"].size(), 4u);
  EXPECT_EQ(json["trials"][0]["psnr_db"], 41.25);
  EXPECT_EQ(json["trials"][0]["exact"], false);
  EXPECT_EQ(json["trials"][0]["on_front"], false);
  EXPECT_EQ(json["trials"][1]["crops_per_s"], 2500);
  EXPECT_TRUE(json["trials"][1]["psnr_db"].is_null());
  EXPECT_EQ(json["trials"][1]["exact"], true);
  EXPECT_EQ(json["trials"][1]["on_front"], true);
  EXPECT_EQ(json["speed_ups"][0]["factor"], 25);
  EXPECT_TRUE(json["builds"][0]["decode_share"].is_null());
  EXPECT_EQ(json["builds"][0]["build_per_s"], 320);
}

TEST(PackSpeed, AQualityThatIsNoneIsRefusedBeforeTheDatasetIsRead) {
  for (const int quality : {0, 101}) {
    PackSpeedOptions options;
    options.folder_quality = quality;
    EXPECT_THAT(MessageOf<UsageError>([&] { MeasurePackSpeed("/nowhere", options, {}); }), HasSubstr("1 to 100"));
  }
  EXPECT_THAT(MessageOf<IoError>([] { MeasurePackSpeed("/nowhere", {}, {}); }), HasSubstr("/nowhere"));
}

}  // namespace
}  // namespace mvstudio::stages
