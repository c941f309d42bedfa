#include "stages/report_fields.h"

#include <cmath>
#include <limits>
#include <vector>

#include "calib/calibrate.h"
#include "calib/check/lens_check.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(ReportFields, KeysInTheOrderOfTheListAndNullForWhatIsNotFinite) {
  calib::CameraMotion motion;
  motion.kind = calib::CameraMotion::Kind::kDrift, motion.cameras = {"a", "b"};
  motion.last_before = 3, motion.frame_idx = 5;
  motion.rotation_rad = std::acos(-1.0), motion.rotation_sigma_rad = std::nan("");
  motion.translation_m = 0.5, motion.focal_scale_sigma = std::numeric_limits<double>::infinity();
  motion.centre_shift_px = {1.5, std::nan("")};
  EXPECT_EQ(FieldsJson(motion).dump(),
            R"({"kind":"drift","cameras":["a","b"],"last_frame_before":3,"first_frame_after":5,"rotation_deg":180.0,)"
            R"("rotation_sigma_deg":null,"translation_mm":500.0,"focal_scale":1.0,"focal_scale_sigma":null,)"
            R"("centre_shift_px":[1.5,null],"shift_px":0.0,"significance":0.0})");
}

TEST(ReportFields, RowsAndFieldsBesideOthers) {
  EXPECT_EQ(RowsJson(std::vector<calib::SelectionRow>()).dump(), "[]");
  calib::SelectionRow row;
  row.camera = "left", row.model = "brown5", row.num_params = 9, row.gross_fraction = std::nan(""), row.chosen = true;
  EXPECT_EQ(RowsJson(std::vector<calib::SelectionRow>{row}).dump(),
            R"([{"camera":"left","model":"brown5","num_params":9,"holdout_rms_px":0.0,"holdout_median_px":0.0,)"
            R"("gross_fraction":null,"chosen":true}])");
  nlohmann::ordered_json json = {{"name", "x"}};
  AddFields(calib::LensCheck(), &json);
  EXPECT_EQ(json.begin().key(), "name");
  EXPECT_EQ(json["status"], "Ok");
}

}  // namespace
}  // namespace mvstudio::stages
