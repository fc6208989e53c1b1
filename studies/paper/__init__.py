"""The tables of Xu, Roy and Kitani, WACV 2020, on scenes whose calibration is trusted."""
