#include <algorithm>
#include <filesystem>
#include <optional>

#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/formats.h"
#include "calib/formats/writers.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/units.h"

/// https://github.com/ethz-asl/kalibr/wiki/yaml-formats; radtan's r1, r2 are p1, p2, and omni's radtan acts behind the mirror.
namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using internal::ValueView;

/// A projection with a distortion of Kalibr's, and the parameters before fu, fv, pu, pv.
struct KalibrLens {
  std::string projection, distortion_model = "none";
  Eigen::VectorXd leading, distortion;
};

/// Ours, or nothing with a reason in `why`.
std::optional<std::pair<LensModel, Eigen::VectorXd>> FromKalibr(const KalibrLens& lens, std::string* why) {
  const Eigen::VectorXd &lead = lens.leading, &k = lens.distortion;
  const bool radtan = lens.distortion_model == "radtan";
  const bool plain = lens.distortion_model == "none" || (radtan && k.isZero(0));  // equidistant has no identity
  Eigen::VectorXd with_p(lead.size() + 2);
  if (radtan) with_p << lead, k.tail<2>();
  if (lens.projection == "pinhole") {
    if (lens.distortion_model == "equidistant") return {{LensModel::kKannalaBrandt4, k}};
    if (plain) return {{LensModel::kPinhole, Eigen::VectorXd()}};
    if (radtan) return {{LensModel::kBrown4, k}};
  } else {
    const bool omni = lens.projection == "omni", eucm = lens.projection == "eucm";
    if (plain) return {{omni ? LensModel::kUcm : eucm ? LensModel::kEucm : LensModel::kDoubleSphere, lead}};
    if (radtan && k.head<2>().isZero(0)) {
      return {{omni ? LensModel::kUcmP : eucm ? LensModel::kEucmP : LensModel::kDoubleSphereP, with_p}};
    }
    if (radtan) {
      *why = lens.projection + " with radtan's k1 and k2 is no lens model here (its p1 and p2 are)";
      return std::nullopt;
    }
  }
  *why = "distortion_model '" + internal::Printable(lens.distortion_model) + "' of " + lens.projection + " is not known here";
  return std::nullopt;
}

std::optional<KalibrLens> ToKalibr(const geometry::Camera& camera) {
  const Eigen::VectorXd own = camera.params.tail(camera.params.size() - 4);
  const auto with_p = [&](const char* projection, Eigen::Index count) {
    KalibrLens lens{projection, "none", own.head(count), {}};
    if (own.size() > count)
      lens.distortion_model = "radtan", lens.distortion = Eigen::Vector4d(0, 0, own[count], own[count + 1]);
    return lens;
  };
  switch (camera.model) {
    case LensModel::kUcm:
    case LensModel::kUcmP:
      return with_p("omni", 1);
    case LensModel::kEucm:
    case LensModel::kEucmP:
      return with_p("eucm", 2);
    case LensModel::kDoubleSphere:
    case LensModel::kDoubleSphereP:
      return with_p("ds", 2);
    default:
      break;
  }
  const auto opencv = internal::ToOpenCvLens(camera);
  if (!opencv || opencv->distortion.size() > 4) return std::nullopt;
  const char* const model = opencv->fisheye ? "equidistant" : opencv->distortion.size() == 0 ? "none" : "radtan";
  return KalibrLens{"pinhole", model, {}, opencv->distortion};
}

geometry::Camera ReadLens(const ValueView& view, const std::string& name) {
  KalibrLens lens;
  lens.projection = view["camera_model"].Text();
  const Eigen::Index lead = lens.projection == "pinhole" ? 0 : lens.projection == "omni" ? 1 : 2;
  if (lead == 2 && lens.projection != "eucm" && lens.projection != "ds") {
    view["camera_model"].Fail("'" + internal::Printable(lens.projection) + "' is not known here (pinhole, omni, eucm, ds)");
  }
  const Eigen::VectorXd intrinsics = view["intrinsics"].Vector(static_cast<size_t>(4 + lead));
  lens.leading = intrinsics.head(lead);
  if (view.Has("distortion_model")) lens.distortion_model = view["distortion_model"].Text();
  if (lens.distortion_model != "none") {
    lens.distortion = view["distortion_coeffs"].Vector();
  } else if (view.Has("distortion_coeffs") && !view["distortion_coeffs"].Vector().isZero(0)) {
    view["distortion_coeffs"].Fail(view.Has("distortion_model") ? "distortion_model says none, these coefficients are not zero"
                                                                : "without distortion_model it is not known what they mean");
  }
  const bool four = lens.distortion_model == "radtan" || lens.distortion_model == "equidistant";
  if (four && lens.distortion.size() != 4) view["distortion_coeffs"].Fail("4 numbers were expected");
  std::string why;
  const auto own = FromKalibr(lens, &why);
  if (!own) view.Fail(why);
  Eigen::VectorXd params(4 + own->second.size());
  params << intrinsics.tail<4>(), own->second;
  const Eigen::VectorXd size = view["resolution"].Vector(2);
  return internal::MakeModelCamera(name, size[0], size[1], own->first, params, view.place());
}

/// EuRoC's words for the same lenses.
geometry::Camera ReadEurocLens(const ValueView& root, const std::string& name) {
  if (root["camera_model"].Text() != "pinhole") root["camera_model"].Fail("pinhole was expected");
  KalibrLens lens{"pinhole", "none", {}, {}};
  const std::string word = root.Has("distortion_model") ? root["distortion_model"].Text() : "none";
  if (word != "none") {
    lens.distortion_model = word == "radial-tangential" || word == "radtan" ? "radtan" : word;
    lens.distortion = root["distortion_coefficients"].Vector(4);
  }
  std::string why;
  const auto own = FromKalibr(lens, &why);
  if (!own || (lens.distortion_model != "none" && lens.distortion_model != "radtan" && word != "equidistant"))
    root["distortion_model"].Fail("'" + internal::Printable(word) +
                                  "' is not known here (radial-tangential, equidistant, none)");
  Eigen::VectorXd params(4 + own->second.size());
  params << root["intrinsics"].Vector(4), own->second;
  const Eigen::VectorXd size = root["resolution"].Vector(2);
  return internal::MakeModelCamera(name, size[0], size[1], own->first, params, root.place());
}

/// `data` of 16 numbers, row by row, or a list of rows.
geometry::Rigid3 EurocTransform(const ValueView& view) {
  if (!view.Has("data")) return view.Transform();
  const Eigen::VectorXd numbers = view["data"].Vector(16);
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) view["data"].Fail("the last row is not 0 0 0 1");
  return {internal::MakeRotation(matrix.topLeftCorner<3, 3>(), view.place()), matrix.topRightCorner<3, 1>()};
}

/// The folder of a sensor.yaml, as EuRoC names cameras; else the file.
std::string NameOfSensor(const std::string& path) {
  namespace fs = std::filesystem;
  const std::string folder = fs::absolute(path).parent_path().filename().string();
  return fs::path(path).stem() == "sensor" && !folder.empty() ? folder : internal::Stem(path);
}

/// NAME of a rostopic /NAME/image_raw, as WriteKalibr writes it; else the key.
std::string ReadName(const ValueView& view, const std::string& key) {
  if (!view.Has("rostopic") || view["rostopic"].value().kind != internal::Value::Kind::kText) return key;
  const std::string& topic = view["rostopic"].Text();
  const std::string ending = "/image_raw";
  if (topic.size() < ending.size() + 2 || topic[0] != '/') return key;
  if (topic.compare(topic.size() - ending.size(), ending.size(), ending) != 0) return key;
  const std::string name = topic.substr(1, topic.size() - ending.size() - 1);
  return name.find('/') == std::string::npos ? name : key;
}

}  // namespace

ImportedRig ReadEuroc(const std::vector<std::string>& paths, const ReadOptions& options) {
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("EuRoC's body");
  for (const std::string& path : paths) {
    const internal::Value document = internal::ParseYaml(path, ReadFile(path));
    const ValueView root(path, document);
    if (root.Has("sensor_type") && root["sensor_type"].Text() != "camera")
      root["sensor_type"].Fail("is '" + internal::Printable(root["sensor_type"].Text()) + "', a camera was expected");
    geometry::RigCamera camera;
    camera.camera = ReadEurocLens(root, NameOfSensor(path));
    geometry::Rigid3 body_from_cam = EurocTransform(root["T_BS"]);
    body_from_cam.translation *= options.metres_per_unit;
    camera.cam_from_world = Inverse(body_from_cam);
    internal::AddCamera(std::move(camera), root.place(), &imported.rig);
    geometry::UnusedKeys unused(path, options.metres_per_unit);
    internal::AddUnused(root, {"comment", "ratehz", "cols", "rows", "dt"}, &unused);
    internal::AddUnusedNote(unused, &imported);
  }
  return imported;
}

namespace {

geometry::Rigid3 PoseAt(const ValueView& view, const char* key, const ReadOptions& options) {
  geometry::Rigid3 pose = view[key].Transform();
  pose.translation *= options.metres_per_unit;
  return pose;
}

/// cam0, cam1, … of a file. Throws FormatError where the numbers have a gap.
std::vector<ValueView> ChainOf(const ValueView& root) {
  std::vector<ValueView> chain;
  while (root.Has("cam" + std::to_string(chain.size()))) chain.push_back(root["cam" + std::to_string(chain.size())]);
  for (const auto& [key, value] : root.value().entries) {
    const bool numbered =
        key.size() > 3 && key.rfind("cam", 0) == 0 && key.find_first_not_of("0123456789", 3) == std::string::npos;
    if (!value.used && numbered)
      root.Fail("there is " + internal::Printable(key) + " and no cam" + std::to_string(chain.size()) +
                ": the numbers of a chain have no gap");
  }
  if (chain.empty()) throw FormatError(root.place().path, "cam0", "this entry is missing");
  return chain;
}

bool HasImu(const ValueView& view) { return view.Has("T_cam_imu") || view.Has("T_imu_cam"); }

/// A pose that the file states twice. Throws FormatError where the two differ by more than hands round.
void CheckSame(const geometry::Rigid3& a, const geometry::Rigid3& b, const ValueView& view, const std::string& what) {
  constexpr double kMaxTurn = 0.01, kMaxShift = 0.005, kMaxShare = 0.02;  // rad, m, of the length
  const double turn = geometry::RotationAngle(a.rotation, b.rotation), shift = (a.translation - b.translation).norm();
  if (turn <= kMaxTurn && shift <= std::max(kMaxShift, kMaxShare * a.translation.norm())) return;
  view.Fail(what + Format(" are two different poses, %.3g degrees and %.4g m apart", RadToDeg(turn), shift) +
            ": one of them was changed or is the other way round; take the wrong one out");
}

/// Camera from IMU: Kalibr's T_cam_imu, or OpenVINS's T_imu_cam the other way round.
geometry::Rigid3 FromImu(const ValueView& view, const ReadOptions& options) {
  if (!view.Has("T_imu_cam")) return PoseAt(view, "T_cam_imu", options);
  const geometry::Rigid3 inverted = Inverse(PoseAt(view, "T_imu_cam", options));
  if (!view.Has("T_cam_imu")) return inverted;
  const geometry::Rigid3 stated = PoseAt(view, "T_cam_imu", options);
  CheckSame(stated, inverted, view, "T_cam_imu and the inverse of T_imu_cam");
  return stated;
}

/// Pose against the camera before: T_cn_cnm1, else by the IMU that both name; nothing where the file has neither.
std::optional<geometry::Rigid3> FromPrevious(const ValueView& previous, const ValueView& view, const ReadOptions& options) {
  std::optional<geometry::Rigid3> by_chain, by_imu;
  if (view.Has("T_cn_cnm1")) by_chain = PoseAt(view, "T_cn_cnm1", options);
  if (HasImu(view) && HasImu(previous)) by_imu = FromImu(view, options) * Inverse(FromImu(previous, options));
  if (by_chain && by_imu)
    CheckSame(*by_chain, *by_imu, view, "T_cn_cnm1 and that by T_cam_imu of this camera and the one before");
  return by_chain ? by_chain : by_imu;
}

void AddChain(const std::vector<ValueView>& chain, bool by_imu, bool placed, bool several, const ReadOptions& options,
              ImportedRig* imported) {
  geometry::Rigid3 from_world;
  for (size_t i = 0; i < chain.size(); ++i) {
    const ValueView& view = chain[i];
    const std::string stem = internal::Stem(view.place().path);
    geometry::RigCamera camera;
    camera.camera = ReadLens(view, ReadName(view, !several           ? view.where()
                                                  : chain.size() > 1 ? stem + "_" + view.where()
                                                                     : stem));
    const auto from_previous = i > 0 ? FromPrevious(chain[i - 1], view, options) : std::nullopt;
    if (by_imu) {
      camera.cam_from_world = FromImu(view, options);
    } else if (placed && i > 0) {
      if (!from_previous)
        view.Fail("the key 'T_cn_cnm1' is missing: nothing places this camera and those after it against " +
                  chain[i - 1].where() +
                  "; add it (or T_cam_imu to both), or give the cameras in files of their own for their lenses alone");
      camera.cam_from_world = *from_previous * imported->rig.cameras.back().cam_from_world;
    }
    internal::AddCamera(std::move(camera), view.place(), &imported->rig);
  }
}

/// Kalibr's clocks, t_imu = t_cam + timeshift_cam_imu in seconds, against the first camera's: at one moment a camera's stamp is
/// later by what its shift is less, and equal frame numbers mean equal stamps. Equal shifts mean nothing.
void CarryTimeShifts(const std::vector<std::vector<ValueView>>& chains, const ReadOptions& options, ImportedRig* imported) {
  std::vector<double> shifts_s;
  for (const auto& chain : chains) {
    for (const ValueView& view : chain) {
      if (view.Has("timeshift_cam_imu")) shifts_s.push_back(view["timeshift_cam_imu"].Number());
    }
  }
  if (shifts_s.size() < 2) return;
  const auto [least, most] = std::minmax_element(shifts_s.begin(), shifts_s.end());
  constexpr double kLeastApart_s = 1e-4;
  if (*most - *least < kLeastApart_s) return;
  std::vector<geometry::RigCamera>& cameras = imported->rig.cameras;
  const bool all = shifts_s.size() == cameras.size();
  const std::string text = chains[0][0].place().path +
                           Format(": timeshift_cam_imu differs by up to %.3g ms: ", (*most - *least) * 1e3) +
                           "the clocks of these cameras are offset against each other; ";
  if (!all || options.frame_rate_hz <= 0) {
    imported->notes.push_back(
        {"CAL-KEYS", text + (all ? "frames need their rate" : "one camera states none") + ", so that it is not carried on",
         all ? "option 'frame-rate' of calib convert carries it on, or find the offsets by mvstudio sync"
             : "find the offsets of the recording by mvstudio sync"});
    return;
  }
  for (size_t c = 0; c < cameras.size(); ++c)
    cameras[c].time_offset = geometry::TimeOffset{(shifts_s[0] - shifts_s[c]) * options.frame_rate_hz, 0};
  imported->notes.push_back({"CAL-KEYS", text + Format("taken as time offsets at %g frames a second", options.frame_rate_hz),
                             "they hold where frames of equal numbers have equal time stamps"});
}

}  // namespace

ImportedRig ReadKalibr(const std::string& path, const ReadOptions& options) {
  return internal::ReadKalibrChains({path}, options);
}

ImportedRig internal::ReadKalibrChains(const std::vector<std::string>& paths, const ReadOptions& options) {
  std::vector<Value> documents;
  std::vector<std::vector<ValueView>> chains;
  for (const std::string& path : paths) documents.push_back(ParseYaml(path, ReadFile(path)));
  bool placed = false, all_by_imu = true;  // placed, some of them: then a pose that is missing is damage
  for (size_t f = 0; f < paths.size(); ++f) {
    chains.push_back(ChainOf(ValueView(paths[f], documents[f])));
    for (size_t i = 0; i < chains[f].size(); ++i) {
      placed |= i > 0 && chains[f][i].Has("T_cn_cnm1");
      all_by_imu &= HasImu(chains[f][i]);
    }
  }
  const bool several = paths.size() > 1, by_imu = all_by_imu && (several || !placed);
  if (several && placed && !by_imu)
    throw FormatError(paths[1], "",
                      "nothing places its cameras against those of " + paths[0] +
                          ": several camchains are one rig where every camera has T_cam_imu; else give one");
  ImportedRig imported;
  for (const auto& chain : chains) AddChain(chain, by_imu, placed, several, options, &imported);
  CarryTimeShifts(chains, options, &imported);
  imported.rig.gauge =
      by_imu ? geometry::RigGauge::Other("Kalibr's IMU") : geometry::RigGauge::OfCamera(imported.rig.cameras[0].camera.name);
  for (size_t f = 0; f < paths.size(); ++f) {
    geometry::UnusedKeys unused(paths[f], options.metres_per_unit);
    AddUnused(ValueView(paths[f], documents[f]), {"rostopic", "camoverlaps", "tcamimu", "timucam"}, &unused);
    AddUnusedNote(unused, &imported);
  }
  if (!placed && !by_imu && imported.rig.cameras.size() > 1) StateLensesOnly(&imported);
  return imported;
}

bool internal::KalibrCanCarry(const geometry::Camera& camera) { return ToKalibr(camera).has_value(); }

internal::Files internal::WriteKalibr(const geometry::Rig& rig, const std::string& path) {
  std::string text;
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const geometry::Camera& camera = rig.cameras[i].camera;
    const KalibrLens lens = *ToKalibr(camera);
    Eigen::VectorXd intrinsics(lens.leading.size() + 4);
    intrinsics << lens.leading, camera.params.head<4>();
    text += "cam" + std::to_string(i) + ":\n";
    if (i > 0) {
      const Eigen::Matrix4d matrix = ToMatrix(rig.cameras[i].cam_from_world * Inverse(rig.cameras[i - 1].cam_from_world));
      text += "  T_cn_cnm1:\n";
      for (int r = 0; r < 4; ++r) text += "  - " + ListText(matrix.row(r)) + "\n";
    }
    text += "  cam_overlaps: []\n  camera_model: " + lens.projection + "\n  distortion_coeffs: " + ListText(lens.distortion) +
            "\n  distortion_model: " + lens.distortion_model + "\n  intrinsics: " + ListText(intrinsics) + "\n  resolution: [" +
            std::to_string(camera.width_px) + ", " + std::to_string(camera.height_px) +
            "]\n  rostopic: " + Quoted("/" + FileName(camera.name) + "/image_raw") + "\n";
  }
  WriteFileAtomic(path, text);
  return {path};
}

}  // namespace mvstudio::calib
