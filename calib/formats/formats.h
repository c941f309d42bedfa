#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/notice.h"
#include "geometry/rig/file_keys.h"
#include "geometry/rig/rig.h"

/// Calibration files of other programs. Every reader returns metres, `cam_from_world` and pixel (0, 0) at the centre of
/// the top-left pixel, and throws IoError or FormatError with the place. Every writer takes the same.
/// docs/calibration-formats.md explains each format and the assumptions made where it is silent. (CMU Panoptic's JSON:
/// dataset/panoptic/panoptic.h.)
namespace mvstudio::calib {

enum class CalibrationFormat {
  kMvstudio,    ///< "mvstudio": geometry/rig/rig_io.h
  kPanoptic,    ///< "panoptic": dataset/panoptic/panoptic.h
  kToml,        ///< "toml" (also "qualisys", "pose2sim", "aniposelib"): a table per camera at the top
  kCaliscope,   ///< "caliscope": the same tables under [cameras]
  kQca,         ///< "qca"
  kOpenCvYaml,  ///< "opencv"
  kMrcal,       ///< "mrcal": a .cameramodel per camera
  kColmap,      ///< "colmap": folder with cameras.bin, images.bin, points3D.bin
  kColmapText,  ///< "colmap-text": folder with the .txt files
  kNerfstudio,  ///< "nerfstudio": transforms.json
  kKalibr,      ///< "kalibr": camchain.yaml
  kEasyMocap,   ///< "easymocap": folder with intri.yml and extri.yml
  // Layouts of datasets that hold the cameras too: read and written by exports/.
  kZju,          ///< "zju": annots.npy
  kActorsHq,     ///< "actorshq": calibration.csv
  kDynamic3dgs,  ///< "dynamic3dgs": train_meta.json, test_meta.json
  kDna,          ///< "dna": *_annots.smc
  kHumman,       ///< "humman": cameras.json
  kNpz,          ///< "npz": joints.npz
  kGltf,         ///< "gltf": .glb, .gltf
  kPly,          ///< "ply": rig.ply
};

inline constexpr CalibrationFormat kAllCalibrationFormats[] = {
    CalibrationFormat::kMvstudio,   CalibrationFormat::kPanoptic,   CalibrationFormat::kToml,   CalibrationFormat::kCaliscope,
    CalibrationFormat::kQca,        CalibrationFormat::kOpenCvYaml, CalibrationFormat::kMrcal,  CalibrationFormat::kColmap,
    CalibrationFormat::kColmapText, CalibrationFormat::kNerfstudio, CalibrationFormat::kKalibr, CalibrationFormat::kEasyMocap};
/// Of dataset/exports/read/layout_read.h and dataset/exports/export.h; the functions below do not take them.
inline constexpr CalibrationFormat kDatasetLayouts[] = {
    CalibrationFormat::kZju,    CalibrationFormat::kActorsHq, CalibrationFormat::kDynamic3dgs, CalibrationFormat::kDna,
    CalibrationFormat::kHumman, CalibrationFormat::kNpz,      CalibrationFormat::kGltf,        CalibrationFormat::kPly};
constexpr bool IsDatasetLayout(CalibrationFormat format) { return format >= CalibrationFormat::kZju; }

std::string_view ToString(CalibrationFormat format);
std::optional<CalibrationFormat> CalibrationFormatFromString(std::string_view name);
/// Whether lengths in its files are in whatever unit their writer took: all but mvstudio, panoptic and qca.
bool NamesNoUnit(CalibrationFormat format);
/// "mvstudio, panoptic, …", with the layouts of datasets.
std::string CalibrationFormatNames();
/// As an option (core/fields.h): a format's name, or auto for none. Throws UsageError that names `option`.
std::string_view ToString(const std::optional<CalibrationFormat>& format);
void FromString(const std::string& text, const std::string& option, std::optional<CalibrationFormat>* format);

/// Detects the format by content, then by name; a folder by the files in it. Throws FormatError for an unknown format; it names
/// layouts of other programs that are known and not read.
CalibrationFormat DetectFormat(const std::string& path);

/// The path itself, or what holds the calibration in a folder that has one inside: `calibration.json` of a run, `sparse/0` of a
/// COLMAP project, the one `calibration_*.json` of a Panoptic dataset.
std::string CalibrationIn(const std::string& path);

/// CAL-KEYS: the file has keys that its reader does not use (geometry::UnusedKeys::Text).
Notice UnusedKeysNote(const std::string& keys);

struct ImportedRig {
  geometry::Rig rig;
  std::vector<Notice> notes;
};

/// Values that files may leave open.
struct ReadOptions {
  int width_px = 0, height_px = 0;    ///< image size where the file does not give it (opencv, easymocap, nerfstudio)
  double metres_per_unit = 1;         ///< of formats that name no unit: all but mvstudio, panoptic and qca
  double qca_distortion_divisor = 1;  ///< see ReadQca
  geometry::LensKind lens =
      geometry::LensKind::kUnsaid;    ///< where the file does not say it (opencv, easymocap, nerfstudio, toml)
  double allow_approximation_px = 0;  ///< a skew is replaced by a turn about the axis if no pixel moves farther than this
  double frame_rate_hz = 0;           ///< of cameras whose file states time offsets in seconds (kalibr); 0: unknown
};

/// Reads any format but panoptic. Formats with a file per camera (mrcal, opencv) take several paths; formats with several
/// files also take a folder.
ImportedRig ReadCalibration(CalibrationFormat format, const std::vector<std::string>& paths, const ReadOptions& options = {});

/// Puts the nearest camera without skew in place of one whose matrix has `skew_px` at K[0][1] (geometry/lens/skew.h); the turn
/// goes into its pose, and a note says so. Throws FormatError when it is off by more than options.allow_approximation_px, and
/// 0.01 px.
void ReplaceSkew(double skew_px, const ReadOptions& options, const std::string& path, const std::string& where,
                 geometry::RigCamera* camera, std::vector<Notice>* notes);

struct WriteOptions {
  double metres_per_unit = 1;         ///< of formats that name no unit; 0.001 writes millimetres
  double allow_approximation_px = 0;  ///< a lens that the format does not support is replaced by the nearest supported one if
                                      ///< no pixel moves farther than this; 0: such a lens is refused
  double qca_distortion_divisor = 1;  ///< see ReadQca: coefficients in the file are ours times this
};

struct ExportReport {
  std::vector<std::string> files;
  std::vector<Notice> notes;
};

/// True when the format supports this lens exactly.
bool CanCarry(CalibrationFormat format, const geometry::Camera& camera);

/// The rig with unsupported lenses replaced as WriteOptions says; adds a note for each. Throws FormatError (`path`, the
/// camera's name) when one is refused.
geometry::Rig RigForFormat(const geometry::Rig& rig, CalibrationFormat format, const WriteOptions& options,
                           const std::string& path, std::vector<Notice>* notes);

/// Writes any format but panoptic. `path` is a file, or a folder for the formats with several files (mrcal: a file when
/// the rig has one camera and the path ends in .cameramodel).
ExportReport WriteCalibration(const geometry::Rig& rig, CalibrationFormat format, const std::string& path,
                              const WriteOptions& options = {});

/// Calibration TOML of Pose2Sim, Caliscope and aniposelib: a table per camera (at the top or under [cameras]) with `size`,
/// `matrix`, `distortions` (OpenCV's order; 4 of kannala4 when `fisheye`), `rotation` (world to camera: a Rodrigues vector or a
/// 3x3 matrix) and `translation`. Parsed by toml++. Cameras keep the file's order; those with `ignore = true` are left out.
ImportedRig ReadToml(const std::string& path, const ReadOptions& options = {});

/// Qualisys QCA/QTM calibration (XML, parsed by pugixml; DTDs are refused).
///
/// Conventions, found by comparing files with the TOML made from them. Positions are the camera centre in world, mm. With
/// M = (r11 r12 r13; r21 …), R_cam_from_world = diag(1, -1, -1) M: the file's camera looks along -z, y up. Focal lengths
/// and centres are in 1/64 px; the centre is relative to the sensor's corner, hence minus `left` and `top` of fov_video.
///
/// The distortion is divided by `qca_distortion_divisor`. 1 takes the coefficients as OpenCV's, dimensionless; chessboard
/// images of one studio support it (k1 = -0.051 +- 0.012 measured, -0.047 in the QCA). 64 gives Pose2Sim's interpretation
/// (k1 = -0.0007), so that its TOML and the QCA agree.
///
/// A note reports any divisor but 1 where a lens has distortion. Another one reports coefficients that look like those of
/// the other divisor: |k1| above 1.6 (64 times 0.025) after division, or, divided by 64, below 0.002 in all cameras.
ImportedRig ReadQca(const std::string& path, const ReadOptions& options = {});

/// OpenCV FileStorage YAML 1.0 (parsed by yaml-cpp). One camera: `camera_matrix` + `distortion_coefficients`, with R and T
/// its pose; it is named "camera", or by its file when there are several. Stereo: M1, D1, M2, D2, R, T ("left", "right";
/// world = left camera). Files that do not hold a camera each are merged, because OpenCV's stereo sample writes intrinsics
/// and extrinsics separately. Throws UsageError when the image size is neither in the files nor in the options.
ImportedRig ReadOpenCvYaml(const std::vector<std::string>& paths, const ReadOptions& options = {});

/// EasyMocap's intri.yml (names, K_NAME, dist_NAME, H_NAME, W_NAME) and extri.yml (R_NAME or Rot_NAME, T_NAME), from the two
/// files or their folder.
ImportedRig ReadEasyMocap(const std::vector<std::string>& paths, const ReadOptions& options = {});

/// mrcal's .cameramodel, one file per camera (named by the file), or folders of them: Python literals with lensmodel,
/// intrinsics, extrinsics (rt_fromref: Rodrigues vector, translation) and imagersize.
ImportedRig ReadMrcal(const std::vector<std::string>& paths, const ReadOptions& options = {});

/// A COLMAP model, text or binary: the folder, or its cameras file. Every image is a camera, named by the image without its
/// extension; where one rig (rigs.txt, rigs.bin of COLMAP 3.12) took all images, its cameras are, as they stood in the first
/// image. https://colmap.github.io/format.html
ImportedRig ReadColmap(const std::string& path, const ReadOptions& options = {});

/// A point of a COLMAP model and the images that see it.
struct ColmapModelPoint {
  Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  ///< metres
  std::array<uint8_t, 3> rgb{};
  double error_px = 0;  ///< mean reprojection error, as stored by COLMAP
  struct Seen {
    size_t camera_idx = 0;                         ///< into the rig
    Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< (0, 0) is the centre of the top-left pixel
  };
  std::vector<Seen> track;
};

/// Writes a COLMAP model with points, binary and text side by side, to `folder`; image i shows camera i. Throws UsageError
/// for names with spaces and for lenses that COLMAP does not have.
std::vector<std::string> WriteColmapModel(const geometry::Rig& rig, const std::vector<std::string>& images,
                                          const std::vector<ColmapModelPoint>& points, const std::string& folder);

/// nerfstudio's transforms.json (also instant-ngp's): every frame is a camera, named by its file. A list is the cameras.json of
/// 3D Gaussian splatting, whose principal points are in the middle.
ImportedRig ReadNerfstudio(const std::string& path, const ReadOptions& options = {});

/// Kalibr's camchain.yaml: pinhole, omni, eucm and ds projections with radtan, equidistant or no distortion. World = cam0.
ImportedRig ReadKalibr(const std::string& path, const ReadOptions& options = {});

/// EuRoC's sensor.yaml (ASL dataset format), one file per camera, named by its folder: T_BS is body from camera, in metres;
/// pinhole with radial-tangential, equidistant or no distortion. World = body.
ImportedRig ReadEuroc(const std::vector<std::string>& paths, const ReadOptions& options = {});

}  // namespace mvstudio::calib
