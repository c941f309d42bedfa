#include <algorithm>
#include <cmath>

#include "calib/calibrate.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Advice names causes before what follows from them.
namespace mvstudio::calib {
namespace {

testing::Scene Rectangles(int num_frames, double tilt_rad) {
  testing::SceneOptions options;
  options.num_frames = num_frames, options.max_tilt_rad = tilt_rad, options.noise_px = 0.3;
  options.model = geometry::LensModel::kBrown2, options.board = "chessboard:9x6:60x65mm";
  return testing::MakeScene(options);
}

CalibrateReport AsSquares(const testing::Scene& scene) {
  CalibrateInput input = testing::ToInput(scene);
  input.boards = {ParseBoard("chessboard:9x6:60mm")};
  CalibrateOptions options = testing::PlainOptions();
  options.stretch = AutoOnOff::kAuto;
  return Calibrate(input, options, {});
}

int PlaceOf(const CalibrateReport& report, const std::string& code) {
  const auto& reasons = report.verdict.reasons;
  const auto found = std::find_if(reasons.begin(), reasons.end(), [&](const Notice& reason) { return reason.code == code; });
  return found == reasons.end() ? -1 : static_cast<int>(found - reasons.begin());
}

TEST(VerdictLengths, ALensThatIsNotKnownComesFirst) {
  CalibrateReport report = AsSquares(Rectangles(20, 0.6));
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  report.cameras[1].assumes = true, report.cameras[1].given_up = "focal length assumed";
  report.board_metrics.pair_rms_mm = 1e3 * report.board_size_m;
  report.verdict = Judge(report);
  const int cause = PlaceOf(report, "CAL-ASSUMED"), consequence = PlaceOf(report, "CAL-LENGTHS");
  ASSERT_GE(cause, 0);
  EXPECT_GT(consequence, cause);
  const std::string& hint = report.verdict.reasons[static_cast<size_t>(consequence)].hint;
  EXPECT_NE(hint.find("the lens of camera cam1 is not known yet"), std::string::npos) << hint;
}

/// Cells of 60 x 65 mm taken for squares: many boards tell, few that are hardly tilted do not and say so.
TEST(VerdictLengths, FewBoardsDoNotTellCellsFromPixels) {
  const CalibrateReport many = AsSquares(Rectangles(30, 0.7));
  ASSERT_EQ(many.status, Status::kOk) << many.message;
  EXPECT_EQ(PlaceOf(many, "CAL-ASPECT"), -1) << many.stretch_reason;
  const CalibrateReport few = AsSquares(Rectangles(5, 0.15));
  if (few.status != Status::kOk) return;
  for (size_t c = 0; c < few.cameras.size(); ++c) {
    const geometry::Camera& lens = few.rig.cameras[c].camera;
    const double error = std::abs(std::log(lens.fx() / lens.fy()));
    if (error > 0.01) {
      EXPECT_GT(few.cameras[c].aspect_sigma, 3 * many.cameras[c].aspect_sigma);
      EXPECT_NE(PlaceOf(few, "CAL-ASPECT"), -1) << lens.fx() / lens.fy() << " " << few.cameras[c].aspect_sigma;
    }
  }
}

}  // namespace
}  // namespace mvstudio::calib
