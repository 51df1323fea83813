"""A camera as `cv2.FileStorage` writes it after a calibration."""

YAML = """%YAML:1.0
---
calibration_time: "Mon Mar  3 10:21:08 2025"
image_width: 2048
image_height: 1536
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 3.5124e+03, 0., 1.0172e+03, 0., 3511.9, 771.8,
       0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.081, 0.112, 3.0e-04, -2.0e-04, 0.5 ]
avg_reprojection_error: 0.21
"""
